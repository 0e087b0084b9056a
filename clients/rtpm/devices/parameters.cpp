#include "devices/parameters.hpp"

#include <algorithm>
#include <string_view>
#include <variant>

#include "cli/table.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

std::string text_of(const driver::ParameterValue& value) {
  return printable(gvd::to_text(value), kShownWhole);
}

Json value_json(const driver::ParameterValue& value) {
  return std::visit([](const auto& one) { return Json(one); }, value);
}

}  // namespace

std::string table_of(const gvd::DeviceConfiguration& configuration) {
  std::vector<Row> rows{{"NAME", "VALUE", "UNIT", "RANGE", "DEFAULT", "CHANGES", "DESCRIPTION"}};
  for (const gvd::Parameter& parameter : configuration.parameters) {
    const driver::ParameterSpec& spec = parameter.spec;
    rows.push_back({printable(spec.name), text_of(parameter.value), printable(spec.unit),
                    printable(gvd::range_text(spec)), text_of(spec.default_value),
                    std::string(to_string(spec.mutability)), printable(spec.description)});
  }
  return aligned(rows, rows.front().size());
}

std::string as_comment(const gvd::DeviceConfiguration& configuration) {
  std::string text = "\n// The parameters of this device (rtpm config):\n";
  const std::string table = table_of(configuration);
  for (std::size_t begin = 0; begin < table.size();) {
    const std::size_t end = table.find('\n', begin);
    text += "//   " + table.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  return text;
}

Json json_of(const gvd::DeviceConfiguration& configuration) {
  Json parameters = Json::array();
  for (const gvd::Parameter& parameter : configuration.parameters) {
    const driver::ParameterSpec& spec = parameter.spec;
    parameters.push_back({{"name", spec.name},
                          {"value", value_json(parameter.value)},
                          {"unit", spec.unit},
                          {"range", gvd::range_text(spec)},
                          {"default", value_json(spec.default_value)},
                          {"changes", to_string(spec.mutability)},
                          {"description", spec.description}});
  }
  return {{"model", configuration.model},           {"serial", configuration.serial},
          {"revision", configuration.revision},     {"is_active", configuration.is_active},
          {"is_unsaved", configuration.is_unsaved}, {"parameters", std::move(parameters)}};
}

std::string lines_of(const std::vector<driver::ParameterSetting>& settings) {
  std::string text;
  for (const driver::ParameterSetting& setting : settings)
    text += printable(setting.name) + "=" + text_of(setting.value) + "\n";
  return text;
}

Json json_of(const std::vector<driver::ParameterSetting>& settings) {
  Json json = Json::object();
  for (const driver::ParameterSetting& setting : settings)
    json[setting.name] = value_json(setting.value);
  return json;
}

expected<gvd::ConfigurationClient, SetupError> open_configuration(Context& context,
                                                                  const std::string& device) {
  gvd::ConfigurationClientOptions options;
  options.bind.deadline = context.deadline.value_or(options.bind.deadline);
  options.call = context.call_options();
  auto client = gvd::ConfigurationClient::open(context.node(), device, options);
  if (client) return client;
  return unexpected{with_similar_names(context, device, client.error())};
}

expected<std::optional<gvd::DeviceConfiguration>, SetupError> configuration_of(
    Context& context, const std::string& url) {
  const auto parts = wire::parse_url(url);
  auto catalog =
      introspection::IntrospectionClient::bind(context.node(), dynamic::catalog_url(url));
  if (!parts || !catalog) return std::nullopt;
  const auto objects = catalog->list();
  if (!objects) return std::nullopt;
  const std::string path = gvd::configuration_path(parts->path);
  const bool is_configured = std::ranges::any_of(*(*objects)->objects(), [&](const auto* object) {
    return object->path()->string_view() == path;
  });
  if (!is_configured) return std::nullopt;
  auto client = open_configuration(context, url);
  if (!client) return unexpected{client.error()};
  auto configuration = client->list();
  if (!configuration) return unexpected{configuration.error().words};
  return std::move(*configuration);
}

}  // namespace rtpm::tool
