#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "laboratory/commands.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using laboratory::Plan;
using laboratory::ProgramPlan;

struct UpRequest {
  std::string file{};
  std::vector<std::string> settings{};
  bool is_check = false;
  bool is_unit = false;
  bool is_detached = false;
};

void print_plan(const Context& context, const Plan& plan) {
  Json programs = Json::array();
  std::vector<Row> rows{{"PROGRAM", "AFTER", "RUNS"}};
  for (const std::size_t index : plan.order) {
    const ProgramPlan& program = plan.programs[index];
    laboratory::Words after;
    for (const std::size_t other : program.after)
      after.push_back(plan.programs[other].name);
    rows.push_back({program.name, after.empty() ? "-" : program::joined(after), program.path});
    programs.push_back({{"name", program.name}, {"path", program.path}, {"after", after}});
  }
  if (context.json)
    return print_json({{"name", plan.name}, {"file", plan.file}, {"programs", programs}});
  print_line(plan.file + " is right. The laboratory '" + plan.name + "' starts in this order:");
  std::fputs(aligned(rows, 3).c_str(), stdout);
}

/// Escapes a word of a systemd unit, where % and $ are expanded.
std::string unit_word(const std::string& word) {
  std::string quoted = " \"";
  for (const char letter : word) {
    if (letter == '%' || letter == '$') quoted += letter;
    if (letter == '"' || letter == '\\') quoted += '\\';
    quoted += letter;
  }
  return quoted + '"';
}

void print_unit(const Context& context, const Plan& plan, const UpRequest& request) {
  Duration patience = std::chrono::seconds{5};
  for (const ProgramPlan& program : plan.programs)
    patience += program.stop_patience;
  std::string command = laboratory::program_folders().front() + "/rtpm up" + unit_word(plan.file);
  for (const std::string& setting : request.settings)
    command += " --set" + unit_word(setting);
  if (context.registry != names::kThisHost) command += " --registry" + unit_word(context.registry);
  print_line(
      "[Unit]\nDescription=RTPM laboratory " + plan.name + "\n\n[Service]\nExecStart=" + command +
      "\nRestart=on-failure\nRestartPreventExitStatus=2\nKillMode=mixed\n" + "TimeoutStopSec=" +
      std::to_string(std::chrono::ceil<std::chrono::seconds>(patience).count()) +
      "\n\n[Install]\nWantedBy=default.target");
  const std::string unit = "rtpm-" + plan.name + ".service";
  rt::print_error("rtpm", "write this to ~/.config/systemd/user/" + unit +
                              " and run `systemctl --user enable --now " + unit + "`");
}

int up(Context& context, const UpRequest& request) {
  laboratory::Variables variables;
  for (const std::string& setting : request.settings)
    variables[setting.substr(0, setting.find('='))] = setting.substr(setting.find('=') + 1);
  const auto plan = laboratory::read_plan(request.file, variables);
  if (!plan || (!request.is_check && !request.is_unit))
    return bring_up(context, plan, request.is_detached);
  if (request.is_check) print_plan(context, *plan);
  if (request.is_unit) print_unit(context, *plan, request);
  return kDone;
}

}  // namespace

void add_up(CLI::App& program, Context& context) {
  const auto request = std::make_shared<UpRequest>();
  CLI::App& command = add_command(
      program, context, "up", "Bring up a laboratory: the programs of a file, in order",
      "  rtpm up cell.toml\n"
      "Starts each program when those before it serve, and ends all in reverse order with Ctrl-C;\n"
      "a second Ctrl-C kills them. No process is left, even if rtpm is killed. A file:\n\n"
      "  [[program]]                   # One for each, in order of start.\n"
      "  name = \"registry\"\n"
      "  run = [\"rtpm-registryd\", \"--port\", \"0\"]\n"
      "  [[program]]\n"
      "  name = \"devices\"\n"
      "  run = [\"rtpm-deviced\", \"--port\", \"0\"]\n"
      "  serves = [\"lab/arm0\"]       # Names at the registry; or \"line\": it prints its URL.\n"
      "  restart = \"on-failure\"\n\n"
      "Further keys of a program: after, ready_line, one_shot, ready_deadline, stop_patience, "
      "main,\n"
      "needed, optional, output, environment, config. ${NAME} is a variable of [variables],\n"
      "${PROGRAM.url} where that program serves, ${environment.NAME} one of the environment.\n",
      [request](Context& c) { return up(c, *request); });
  command.add_option("FILE", request->file, "The laboratory, in TOML")->required()->type_name("");
  command.add_flag("--check", request->is_check, "Check the file only");
  command.add_flag("--systemd", request->is_unit, "Print a systemd unit that brings it up");
  command.add_flag("--detach", request->is_detached,
                   "Return when everything serves; `rtpm down` ends it");
  const auto check = [](const std::string& setting) {
    const bool is_right = setting.find('=', 1) != std::string::npos;
    return is_right ? std::string() : "'" + setting + "' of --set is not NAME=VALUE";
  };
  command.add_option("--set", request->settings, "A variable of the file in place of its value")
      ->check(CLI::Validator(check, ""))
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
}

}  // namespace rtpm::tool
