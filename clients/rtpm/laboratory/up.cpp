#include <map>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "laboratory/bring_up.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/file.hpp"

namespace rtpm::tool {
namespace {

using laboratory::Plan;
using laboratory::ProgramPlan;

struct UpRequest {
  std::string file{};
  std::vector<std::string> settings{};
  bool is_check = false;
  BringUpOptions options{};
};

std::string names_of(const Plan& plan, const std::vector<std::size_t>& programs) {
  std::string names;
  for (const std::size_t program : programs)
    names += (names.empty() ? "" : ", ") + plan.programs[program].name;
  return names;
}

Json plan_json(const Plan& plan) {
  Json programs = Json::array();
  for (const std::size_t index : plan.order) {
    const ProgramPlan& program = plan.programs[index];
    Json after = Json::array();
    for (const std::size_t other : program.after)
      after.push_back(plan.programs[other].name);
    programs.push_back({{"name", program.name},
                        {"path", program.path},
                        {"folder", program.folder},
                        {"after", std::move(after)}});
  }
  return {{"name", plan.name}, {"file", plan.file}, {"programs", std::move(programs)}};
}

void print_plan(const Context& context, const Plan& plan) {
  if (context.json) return print_json(plan_json(plan));
  print_line(plan.file + " is right. The laboratory '" + plan.name + "' starts in this order:");
  std::vector<Row> rows{{"PROGRAM", "AFTER", "RUNS"}};
  for (const std::size_t index : plan.order) {
    const ProgramPlan& program = plan.programs[index];
    rows.push_back(
        {program.name, program.after.empty() ? "-" : names_of(plan, program.after), program.path});
  }
  std::fputs(aligned(rows, 3).c_str(), stdout);
}

/// Splits each "NAME=VALUE".
std::map<std::string, std::string> variables_in(const std::vector<std::string>& settings) {
  std::map<std::string, std::string> variables;
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    variables[setting.substr(0, equals)] = setting.substr(equals + 1);
  }
  return variables;
}

int up(Context& context, const UpRequest& request) {
  const auto plan =
      laboratory::read_plan(request.file, {.folders = laboratory::ProgramFolders::of_this_process(),
                                           .variables = variables_in(request.settings)});
  if (!plan) return refuse_file(context, plan.error());
  if (request.is_check) {
    print_plan(context, *plan);
    return kDone;
  }
  return bring_up(context, *plan, request.options);
}

}  // namespace

void add_up(CLI::App& program, Context& context) {
  const auto request = std::make_shared<UpRequest>();
  CLI::App& command = add_command(
      program, context, "up", "Bring up a laboratory: the programs of a file, in order",
      "  rtpm up cell.toml\n"
      "Starts each program when those before it serve, restarts what fails as the file says, and\n"
      "ends all in reverse order with Ctrl-C; a second Ctrl-C kills them. No process is left, "
      "even\n"
      "if rtpm is killed. A file:\n\n"
      "  [laboratory]                  # name, registry, logs, environment\n"
      "  [[program]]                   # One for each, in order of start.\n"
      "  name = \"registry\"\n"
      "  run = [\"rtpm-registryd\", \"--port\", \"0\"]\n"
      "  [[program]]\n"
      "  name = \"devices\"\n"
      "  run = [\"rtpm-deviced\", \"--port\", \"0\"]\n"
      "  serves = [\"lab/arm0\"]       # Names at the registry; or \"line\": it prints its URL.\n"
      "  restart = \"on-failure\"      # never, on-failure, always\n\n"
      "Further keys of a program: after, ready_line, one_shot, ready_deadline, restart_limit,\n"
      "restart_window, restart_delay, restart_delay_max, stop_signal, stop_patience, main, "
      "needed,\n"
      "output, folder, environment. ${NAME} is a variable of [variables], ${PROGRAM.url} where "
      "that\n"
      "program serves, ${environment.NAME} a variable of the environment.\n",
      [request](Context& c) { return up(c, *request); });
  command.add_option("FILE", request->file, "The laboratory, in TOML")->required()->type_name("");
  command.add_flag("--check", request->is_check, "Check the file only");
  command.add_flag("--detach", request->options.is_detached,
                   "Return when everything serves; `rtpm down` ends it");
  const auto check = [](const std::string& setting) {
    const std::size_t equals = setting.find('=');
    const bool is_right = equals != std::string::npos && equals > 0;
    return is_right ? std::string() : "'" + setting + "' of --set is not NAME=VALUE";
  };
  command.add_option("--set", request->settings, "A variable of the file in place of its value")
      ->check(CLI::Validator(check, ""))
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
  add_duration(command, "--for", request->options.time, "How long; without: until Ctrl-C",
               {std::chrono::milliseconds{1}, std::chrono::hours{24 * 365}});
}

}  // namespace rtpm::tool
