#include "objects/live_words.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "devices/parameters.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {
namespace {

using Words = std::vector<std::string>;

bool is_plain(const std::string& word) {
  static constexpr std::string_view kOthers = "_-./:=";
  const auto is_allowed = [](char byte) {
    const bool is_letter = (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z');
    return is_letter || (byte >= '0' && byte <= '9') || kOthers.find(byte) != kOthers.npos;
  };
  return !word.empty() && std::ranges::all_of(word, is_allowed);
}

expected<Words, SetupError> names_now(Context& context) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return unexpected{SetupError{entries.error()}};
  Words words;
  for (const names::NameEntry& entry : *entries)
    words.push_back(entry.name);
  return words;
}

expected<Words, SetupError> methods_of(Context& context, const std::string& target) {
  const auto url = names::url_of(context.node(), context.registry, target);
  if (!url) return unexpected{SetupError{url.error()}};
  const auto object = dynamic::RemoteObject::open(context.node(), *url);
  if (!object) return unexpected{object.error()};
  Words words;
  for (const schema::Method& method : (*object)->dynamic().service().methods)
    words.push_back(method.name);
  return words;
}

/// @param mark  what follows a parameter: "=" where a value does
expected<Words, SetupError> parameters_of(Context& context, const std::string& target,
                                          const std::string& mark) {
  auto client = open_configuration(context, target);
  if (!client) return unexpected{std::move(client.error())};
  const auto configuration = client->list();
  if (!configuration) return unexpected{configuration.error().words};
  Words words;
  for (const gvd::Parameter& parameter : configuration->parameters)
    words.push_back(parameter.spec.name + mark);
  return words;
}

expected<Words, SetupError> calibrations_of(Context& context, const std::string& target) {
  auto client = open_configuration(context, target);
  if (!client) return unexpected{std::move(client.error())};
  const auto calibrations = client->calibrations();
  if (!calibrations) return unexpected{calibrations.error().words};
  Words words;
  for (const driver::CalibrationInfo& calibration : calibrations->calibrations)
    words.push_back(calibration.name);
  return words;
}

expected<Words, SetupError> all_words(Context& context, const std::string& command,
                                      const std::string& target) {
  if (target.empty()) return names_now(context);
  if (command == "call") return methods_of(context, target);
  if (command == "config set") return parameters_of(context, target, "=");
  if (command == "config get" || command == "config reset") {
    return parameters_of(context, target, "");
  }
  if (command == "config calibrate") return calibrations_of(context, target);
  return Words{};
}

}  // namespace

expected<Words, SetupError> live_words(Context& context, const std::string& command,
                                       const std::string& target) {
  auto words = all_words(context, command, target);
  if (words) std::erase_if(*words, [](const std::string& word) { return !is_plain(word); });
  return words;
}

}  // namespace rtpm::tool
