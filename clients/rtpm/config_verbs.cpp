#include "config_verbs.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <span>
#include <utility>

#include "calibration_dialogue.hpp"
#include "parameter_text.hpp"
#include "remote.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/options/suggestion.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"
#include "table.hpp"

namespace rtpm::tool {
namespace {

using driver::ParameterSetting;
using gvd::ConfigurationClient;
using gvd::DeviceConfiguration;

/// One `rtpm config ACTION DEVICE REST…`.
struct Task {
  const Request& request;
  std::string device;
  std::vector<std::string> rest;
  ConfigurationClient client;
  const options::StopSignal* stop = nullptr;  ///< Of `calibrate`.

  [[nodiscard]] int fail(const std::string& text) const {
    rt::print_error("rtpm", device + ": " + text);
    return 1;
  }
  /// What a change is based on.
  [[nodiscard]] std::uint64_t revision_of(const DeviceConfiguration& configuration) const {
    return request.config.revision != 0 ? request.config.revision : configuration.revision;
  }
};

int misuse(const std::string& text) {
  rt::print_error("rtpm", text + "; run 'rtpm config --help'");
  return 2;
}

expected<ConfigurationClient, SetupError> open(const Request& request, const std::string& device) {
  gvd::ConfigurationClientOptions options;
  options.bind.deadline = request.options.deadline.value_or(options.bind.deadline);
  options.call = request.options;
  return ConfigurationClient::open(request.node, device, options);
}

std::string unknown(const DeviceConfiguration& configuration, const std::string& name) {
  std::vector<std::string> names;
  for (const gvd::Parameter& parameter : configuration.parameters)
    names.push_back(parameter.spec.name);
  return "there is no parameter '" + name + "'" + options::suggestion(name, names) +
         "; 'rtpm config list' shows all";
}

/// The first of `names` that is none; empty if all are.
std::string first_unknown(const DeviceConfiguration& configuration,
                          const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (configuration.find(name) == nullptr) return unknown(configuration, name);
  }
  return {};
}

int list(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words.text());
  std::printf("%s, serial %s, %s, revision %llu%s\n\n", printable(configuration->model).c_str(),
              printable(configuration->serial).c_str(),
              configuration->is_active ? "active" : "not active",
              static_cast<unsigned long long>(configuration->revision),
              configuration->is_unsaved ? ", not saved" : "");
  std::fputs(table_of(*configuration).c_str(), stdout);
  return 0;
}

int get(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words.text());
  if (const std::string why = first_unknown(*configuration, task.rest); !why.empty()) {
    return task.fail(why);
  }
  std::vector<ParameterSetting> settings;
  for (const gvd::Parameter& parameter : configuration->parameters) {
    const std::string& name = parameter.spec.name;
    const bool is_meant = task.rest.empty() || std::ranges::count(task.rest, name) > 0;
    if (is_meant) settings.push_back({name, parameter.value});
  }
  std::fputs(lines_of(settings).c_str(), stdout);
  return 0;
}

/// Prints what a change gave.
int show(const Task& task, const expected<gvd::RevisedSettings, gvd::ConfigurationError>& applied) {
  if (!applied) return task.fail(applied.error().words.text());
  std::fputs(lines_of(applied->settings).c_str(), stdout);
  return 0;
}

int set(Task& task) {
  for (const std::string& text : task.rest) {
    const std::size_t sign = text.find('=');
    if (sign == std::string::npos || sign == 0) {
      return misuse("'" + text + "' is no NAME=VALUE");
    }
  }
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words.text());
  std::vector<ParameterSetting> settings;
  for (const std::string& text : task.rest) {
    const std::size_t sign = text.find('=');
    const std::string name = text.substr(0, sign);
    const gvd::Parameter* const parameter = configuration->find(name);
    if (parameter == nullptr) return task.fail(unknown(*configuration, name));
    auto value = gvd::parse_value(parameter->spec, std::string_view(text).substr(sign + 1));
    if (!value) return task.fail(value.error().words.text());
    settings.push_back({name, std::move(*value)});
  }
  return show(task, task.client.apply(task.revision_of(*configuration), settings));
}

int reset(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words.text());
  if (const std::string why = first_unknown(*configuration, task.rest); !why.empty()) {
    return task.fail(why);
  }
  return show(task, task.client.reset(task.revision_of(*configuration), task.rest));
}

int save(Task& task) {
  if (const auto saved = task.client.save(); !saved) return task.fail(saved.error().words.text());
  std::puts("saved");
  return 0;
}

int calibrate(Task& task) {
  const auto offered = task.client.calibrations();
  if (!offered) return task.fail(offered.error().words.text());
  std::vector<Row> rows;
  std::vector<std::string> names;
  for (const driver::CalibrationInfo& info : offered->calibrations) {
    rows.push_back({printable(info.name), printable(info.description)});
    names.push_back(info.name);
  }
  if (task.rest.empty()) {
    if (rows.empty()) std::puts("the device has no calibrations");
    std::fputs(aligned(rows, 2).c_str(), stdout);
    return 0;
  }
  const std::string& name = task.rest.front();
  if (std::ranges::count(names, name) == 0) {
    return task.fail("there is no calibration '" + name + "'" + options::suggestion(name, names) +
                     "; 'rtpm config calibrate' without one shows all");
  }
  return CalibrationDialogue(task.client, task.device, task.request.config, *task.stop).run(name);
}

struct Action {
  std::string_view name{};
  std::size_t count_min = 0;  ///< Of what follows the device.
  std::size_t count_max = 0;
  int (*run)(Task&) = nullptr;
};
constexpr std::size_t kAny = driver::kParameterCountMax;
constexpr std::array kActions{
    Action{"list", 0, 0, &list},      Action{"get", 0, kAny, &get},
    Action{"set", 1, kAny, &set},     Action{"save", 0, 0, &save},
    Action{"reset", 0, kAny, &reset}, Action{"calibrate", 0, 1, &calibrate}};

}  // namespace

int config(const Request& request) {
  const std::vector<std::string>& given = request.arguments;
  const auto* const action = std::ranges::find(kActions, given[0], &Action::name);
  if (action == kActions.end()) {
    return misuse("config does list, get, set, save, reset or calibrate, not '" + given[0] + "'");
  }
  const std::size_t rest_count = given.size() - 2;
  if (rest_count < action->count_min || rest_count > action->count_max) {
    return misuse("config " + given[0] + " takes " +
                  (action->count_max == 0   ? "a device only"
                   : action->count_min == 1 ? "a device and NAME=VALUE"
                                            : "a device, and at most one calibration"));
  }
  // Before the node has threads: Ctrl-C discards the run then, and ends no program.
  const bool is_calibrating = action->run == &calibrate;
  const auto stop = is_calibrating ? std::make_unique<options::StopSignal>() : nullptr;
  auto client = open(request, given[1]);
  if (!client) {
    rt::print_error("rtpm", given[1] + ": " + client.error().text());
    return 1;
  }
  Task task{request, given[1], {given.begin() + 2, given.end()}, std::move(*client), stop.get()};
  return action->run(task);
}

expected<std::string, SetupError> parameters_as_comment(const Request& request,
                                                        const std::string& url) {
  const auto parts = wire::parse_url(url);
  auto catalog = introspection::IntrospectionClient::bind(request.node, catalog_url(url));
  if (!parts || !catalog) return std::string{};
  const auto objects = catalog->list();
  if (!objects) return std::string{};
  const std::string path = gvd::configuration_path(parts->path);
  const bool is_configured = std::ranges::any_of(*(*objects)->objects(), [&](const auto* object) {
    return object->path()->string_view() == path;
  });
  if (!is_configured) return std::string{};
  auto client = open(request, url);
  if (!client) return unexpected{client.error()};
  const auto configuration = client->list();
  if (!configuration) return unexpected{configuration.error().words};
  std::string text = "\n// The parameters of this device (rtpm config):\n";
  const std::string table = table_of(*configuration);
  for (std::size_t begin = 0; begin < table.size();) {
    const std::size_t end = table.find('\n', begin);
    text += "//   " + table.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  return text;
}

}  // namespace rtpm::tool
