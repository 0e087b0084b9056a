#include "rtpm/configuration/settings_store.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/configuration/device_file.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "rtpm/rt/durable_file.hpp"

namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;
using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;
using nlohmann::json;

constexpr std::string_view kFormat = "rtpm-settings";
constexpr int kFormatVersion = 1;
constexpr const char* kRemedy =
    "restore the file from a copy, or remove it to begin with the defaults";

std::string dump(const json& value, int indent = -1) {
  return value.dump(indent, ' ', false, json::error_handler_t::replace);
}

std::string checksum_of(const json& document) {
  json covered = document;
  covered.erase("checksum");
  std::array<char, 17> digits{};
  std::snprintf(digits.data(), digits.size(), "%016llx",
                static_cast<unsigned long long>(fnv1a_64(dump(covered))));
  return digits.data();
}

json json_of(const ParameterValue& value) {
  return std::visit([](const auto& held) { return json(held); }, value);
}

template <class T>
std::optional<ParameterValue> value_if(bool is_one, const json& stored) {
  if (!is_one) return std::nullopt;
  return ParameterValue(stored.get<T>());
}

std::optional<ParameterValue> value_of(ParameterType type, const json& stored) {
  switch (type) {
    case ParameterType::kBool:
      return value_if<bool>(stored.is_boolean(), stored);
    case ParameterType::kInteger:
      return value_if<std::int64_t>(stored.is_number_integer(), stored);
    case ParameterType::kReal:
      return value_if<double>(stored.is_number(), stored);
    case ParameterType::kText:
    case ParameterType::kChoice:
      return value_if<std::string>(stored.is_string(), stored);
    case ParameterType::kVector:
      return value_if<std::vector<double>>(
          stored.is_array() &&
              std::ranges::all_of(stored, [](const json& value) { return value.is_number(); }),
          stored);
  }
  return std::nullopt;
}

/// The file's text; nullopt if there is no file.
expected<std::optional<std::string>, std::string> read(const std::string& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) return std::nullopt;
  if (status.type() != std::filesystem::file_type::regular) {
    return unexpected{std::string(error ? error.message() : "it is no file")};
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(SettingsStore::kFileSizeMax + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) return unexpected{std::string("it can't be read")};
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > SettingsStore::kFileSizeMax) {
    return unexpected{"it is larger than " + std::to_string(SettingsStore::kFileSizeMax) +
                      " bytes"};
  }
  return text;
}

/// The text of a member; empty if it is not text.
std::string text_in(const json& document, const char* key) {
  const auto found = document.find(key);
  return found != document.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

/// The fault of the document, regardless of its device; empty if it has none.
std::string fault_of(const json& document) {
  if (document.is_discarded()) return "it is truncated, or no JSON";
  if (!document.is_object() || text_in(document, "format") != kFormat) {
    return "it is no settings file of RTPM";
  }
  const auto version = document.find("format_version");
  if (version == document.end() || *version != kFormatVersion) {
    return "its format is of another version than " + std::to_string(kFormatVersion);
  }
  if (text_in(document, "checksum") != checksum_of(document)) {
    return "its checksum is wrong: it was damaged, or changed by hand";
  }
  const auto parameters = document.find("parameters");
  if (parameters == document.end() || !parameters->is_object()) return "it has no parameters";
  return {};
}

}  // namespace

SettingsStore::SettingsStore(const std::string& folder, std::string model, std::string serial)
    : folder_(folder),
      model_(std::move(model)),
      serial_(std::move(serial)),
      path_(device_file(folder, model_, serial_, ".json")) {}

expected<StoredSettings, SetupError> SettingsStore::load(std::span<const ParameterSpec> specs) {
  const auto refused = [&](std::string why) {
    return setup_error("the settings file '" + path_ + "' is refused", std::move(why), kRemedy);
  };
  auto text = read(path_);
  if (!text) return refused(text.error());
  if (!*text) return StoredSettings{};
  const json document = parse_bounded_json<json>(**text);
  if (auto fault = fault_of(document); !fault.empty()) return refused(std::move(fault));
  const std::string model = text_in(document, "model");
  const std::string serial = text_in(document, "serial");
  // Compares the written form: writing replaces bytes that are not UTF-8.
  if (json(model) != parse_bounded_json<json>(dump(json(model_))) ||
      json(serial) != parse_bounded_json<json>(dump(json(serial_)))) {
    return refused("it is of the device " + model + ", serial number " + serial +
                   ", and this one is " + model_ + ", serial number " + serial_);
  }
  StoredSettings stored;
  for (const auto& [name, value] : document["parameters"].items()) {
    const auto spec = std::ranges::find(specs, name, &ParameterSpec::name);
    if (spec == specs.end()) {
      unknown_[name] = dump(value);
      stored.ignored.push_back("'" + path_ + "': the device has no parameter " + name +
                               "; its value stays in the file");
      continue;
    }
    const auto read_value = value_of(spec->type, value);
    if (!read_value || check(*spec, *read_value) != driver::ValueFault::kNone) {
      const std::string range = range_text(*spec);
      stored.ignored.push_back("'" + path_ + "': " + name + " = " + dump(value) +
                               " is not valid any more" +
                               (range.empty() ? "" : " (" + range + ")") + "; the default is used");
      continue;
    }
    stored.settings.push_back({name, *read_value});
  }
  return stored;
}

expected<void, SetupError> SettingsStore::save(std::span<const ParameterSetting> settings) const {
  json parameters = json::object();
  for (const auto& [name, value] : unknown_) {
    parameters[name] = parse_bounded_json<json>(value);
  }
  for (const ParameterSetting& setting : settings) {
    parameters[setting.name] = json_of(setting.value);
  }
  json document{{"format", kFormat},
                {"format_version", kFormatVersion},
                {"model", model_},
                {"serial", serial_},
                {"parameters", std::move(parameters)}};
  // Normalised to the form that will be read back.
  document = parse_bounded_json<json>(dump(document));
  document["checksum"] = checksum_of(document);
  std::error_code error;
  std::filesystem::create_directory(folder_, error);
  if (const auto replaced = rt::replace_file(path_, dump(document, 1) + "\n"); !replaced) {
    return setup_error("the settings file '" + path_ + "' can't be written", replaced.error(),
                       "let the device's server write to that folder, or name another");
  }
  return {};
}

}  // namespace rtpm::gvd
