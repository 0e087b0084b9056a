#include <algorithm>
#include <cstdio>
#include <utility>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "devices/calibration_dialogue.hpp"
#include "devices/commands.hpp"
#include "devices/parameters.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::tool {
namespace {

using driver::ParameterSetting;
using gvd::ConfigurationClient;
using gvd::DeviceConfiguration;

/// The arguments of `rtpm config ACTION`.
struct ConfigRequest {
  std::string device{};
  std::vector<std::string> names{};  ///< Names, or NAME=VALUE.
  std::uint64_t revision = 0;  ///< The revision that a change is based on; 0 for the current one.
  DialogueOptions dialogue{};
};

/// One action on a device.
struct Task {
  Context& context;
  const ConfigRequest& request;
  ConfigurationClient client;

  [[nodiscard]] int fail(const std::string& text) const {
    return context.fail(request.device + ": " + text);
  }
  [[nodiscard]] int fail(const SetupError& error) const {
    return context.fail(named(request.device, error));
  }
  /// The revision that a change is based on.
  [[nodiscard]] std::uint64_t revision_of(const DeviceConfiguration& configuration) const {
    return request.revision != 0 ? request.revision : configuration.revision;
  }
};

std::string unknown(const DeviceConfiguration& configuration, const std::string& name) {
  std::vector<std::string> names;
  for (const gvd::Parameter& parameter : configuration.parameters)
    names.push_back(parameter.spec.name);
  return "there is no parameter '" + name + "'" + program::suggestion(name, names) +
         "; 'rtpm config list' shows all";
}

/// The error for the first of `names` that is not a parameter; empty if all exist.
std::string first_unknown(const DeviceConfiguration& configuration,
                          const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (configuration.find(name) == nullptr) return unknown(configuration, name);
  }
  return {};
}

void print_settings(const Task& task, const std::vector<ParameterSetting>& settings) {
  if (task.context.json) {
    print_json(json_of(settings));
  } else {
    std::fputs(lines_of(settings).c_str(), stdout);
  }
}

int list(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words);
  if (task.context.json) {
    print_json(json_of(*configuration));
    return kDone;
  }
  std::printf("%s, serial %s, %s, revision %llu%s\n\n", printable(configuration->model).c_str(),
              printable(configuration->serial).c_str(),
              configuration->is_active ? "active" : "not active",
              static_cast<unsigned long long>(configuration->revision),
              configuration->is_unsaved ? ", not saved" : "");
  std::fputs(table_of(*configuration).c_str(), stdout);
  return kDone;
}

int get(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words);
  const std::vector<std::string>& names = task.request.names;
  if (const std::string why = first_unknown(*configuration, names); !why.empty()) {
    return task.fail(why);
  }
  std::vector<ParameterSetting> settings;
  for (const gvd::Parameter& parameter : configuration->parameters) {
    const std::string& name = parameter.spec.name;
    const bool is_meant = names.empty() || std::ranges::count(names, name) > 0;
    if (is_meant) settings.push_back({name, parameter.value});
  }
  print_settings(task, settings);
  return kDone;
}

/// Prints the result of a change.
int show(const Task& task, const expected<gvd::RevisedSettings, gvd::ConfigurationError>& applied) {
  if (!applied) return task.fail(applied.error().words);
  print_settings(task, applied->settings);
  return kDone;
}

int set(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words);
  std::vector<ParameterSetting> settings;
  for (const std::string& text : task.request.names) {
    const std::size_t sign = text.find('=');
    const std::string name = text.substr(0, sign);
    const gvd::Parameter* const parameter = configuration->find(name);
    if (parameter == nullptr) return task.fail(unknown(*configuration, name));
    auto value = gvd::parse_value(parameter->spec, std::string_view(text).substr(sign + 1));
    if (!value) return task.fail(value.error().words);
    settings.push_back({name, std::move(*value)});
  }
  return show(task, task.client.apply(task.revision_of(*configuration), settings));
}

int reset(Task& task) {
  const auto configuration = task.client.list();
  if (!configuration) return task.fail(configuration.error().words);
  if (const std::string why = first_unknown(*configuration, task.request.names); !why.empty()) {
    return task.fail(why);
  }
  return show(task, task.client.reset(task.revision_of(*configuration), task.request.names));
}

int save(Task& task) {
  if (const auto saved = task.client.save(); !saved) return task.fail(saved.error().words);
  if (task.context.json) {
    print_json({{"is_saved", true}});
  } else {
    std::puts("saved");
  }
  return kDone;
}

int show_calibrations(const Task& task, const std::vector<driver::CalibrationInfo>& calibrations) {
  Json json = Json::array();
  std::vector<Row> rows;
  for (const driver::CalibrationInfo& info : calibrations) {
    rows.push_back({printable(info.name), printable(info.description)});
    json.push_back({{"name", info.name}, {"description", info.description}});
  }
  if (task.context.json) {
    print_json(json);
    return kDone;
  }
  if (rows.empty()) std::puts("the device has no calibrations");
  std::fputs(aligned(rows, 2).c_str(), stdout);
  return kDone;
}

int calibrate(Task& task) {
  const auto offered = task.client.calibrations();
  if (!offered) return task.fail(offered.error().words);
  if (task.request.names.empty()) return show_calibrations(task, offered->calibrations);
  std::vector<std::string> names;
  for (const driver::CalibrationInfo& info : offered->calibrations)
    names.push_back(info.name);
  const std::string& name = task.request.names.front();
  if (std::ranges::count(names, name) == 0) {
    return task.fail("there is no calibration '" + name + "'" + program::suggestion(name, names) +
                     "; 'rtpm config calibrate' without one shows all");
  }
  return CalibrationDialogue(task.client, task.context, task.request.device, task.request.dialogue)
      .run(name);
}

int run(Context& context, const ConfigRequest& request, int (*action)(Task&)) {
  // Called before the node starts threads, so that Ctrl-C discards the run instead of ending the
  // program.
  if (action == &calibrate) static_cast<void>(context.stop());
  auto client = open_configuration(context, request.device);
  if (!client) return context.not_reached(named(request.device, client.error()));
  Task task{context, request, std::move(*client)};
  return action(task);
}

/// Why a text is not NAME=VALUE; empty if it is.
std::string why_no_setting(const std::string& text) {
  const std::size_t sign = text.find('=');
  const bool is_setting = sign != std::string::npos && sign != 0;
  return is_setting ? std::string{} : "'" + text + "' is no NAME=VALUE";
}

class Actions {
 public:
  Actions(CLI::App& group, Context& context) : group_(group), context_(context) {}

  CLI::App& add(const char* name, const char* summary, int (*action)(Task&)) {
    CLI::App& command = add_command(
        group_, context_, name, summary, "",
        [request = request_, action](Context& context) { return run(context, *request, action); });
    add_target(command, request_->device, "DEVICE");
    return command;
  }
  CLI::Option& add_names(CLI::App& command, const char* name, const char* help) {
    return *command.add_option(name, request_->names, help)->type_name("");
  }
  void add_revision(CLI::App& command) {
    add_count(command, "--revision", request_->revision,
              "Change only what has this revision, of 'list'; 0: whatever it has");
  }
  void add_dialogue(CLI::App& command) {
    command.add_option("--answer", request_->dialogue.answers,
                       "The answers to its prompts, the last for all that follow");
    CLI::Option* const keep =
        command.add_flag("--keep", request_->dialogue.keeps, "Keep the result without asking");
    command.add_flag("--discard", request_->dialogue.discards, "Discard the result without asking")
        ->excludes(keep);
  }

 private:
  CLI::App& group_;
  Context& context_;
  std::shared_ptr<ConfigRequest> request_ = std::make_shared<ConfigRequest>();
};

}  // namespace

void add_config(CLI::App& program, Context& context) {
  CLI::App& group = add_command_group(program, "config",
                                      "Show, change, save and calibrate a device's parameters");
  Actions actions(group, context);
  actions.add("list", "List every parameter, its range and default", &list);
  actions.add_names(actions.add("get", "Print values as NAME=VALUE", &get), "NAMES",
                    "Of parameters; without: all");
  CLI::App& setting = actions.add("set", "Make all of these changes, or none", &set);
  actions.add_names(setting, "SETTINGS", "NAME=VALUE").required()->check(&why_no_setting);
  actions.add_revision(setting);
  CLI::App& resetting = actions.add("reset", "Set parameters to their defaults", &reset);
  actions.add_names(resetting, "NAMES", "Of parameters; without: all");
  actions.add_revision(resetting);
  actions.add("save", "Keep the values for the next start of the device's server", &save);
  CLI::App& calibrating = actions.add("calibrate", "Calibrate in a dialogue", &calibrate);
  actions.add_names(calibrating, "NAME", "Of the calibration; without: what there is")
      .expected(0, 1);
  actions.add_dialogue(calibrating);
  calibrating.footer(
      "Reads answers from standard input, or from --answer. At the end it asks whether to keep\n"
      "the result. Ctrl-C cancels, and nothing changes.\n");
}

}  // namespace rtpm::tool
