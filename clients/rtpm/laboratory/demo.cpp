#include <unistd.h>

#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "laboratory/bring_up.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/file.hpp"
#include "rtpm/names/defaults.hpp"

namespace rtpm::tool {
namespace {

constexpr const char* kFile = "demo.toml";
/// Besides the time that the programs are given.
constexpr Duration kStartAndEndTime = std::chrono::seconds{15};
/// Where nobody could press Ctrl-C.
constexpr int kSecondsWithoutTerminal = 10;

struct DemoRequest {
  std::optional<int> seconds{};  ///< 0: until Ctrl-C.
  std::string hand{};
  std::string host{};
};

int demo(Context& context, const DemoRequest& request) {
  laboratory::FileContext file{.folders = laboratory::ProgramFolders::of_this_process()};
  const std::string path = laboratory::shipped_file(file.folders, kFile);
  if (path.empty()) {
    return context.fail({"the demo is not installed",
                         "there is no " + file.folders.own + "/../share/rtpm/" + kFile,
                         "install RTPM's programs again"});
  }
  const bool is_watched = is_terminal() && !context.json;
  const int seconds = request.seconds.value_or(is_watched ? 0 : kSecondsWithoutTerminal);
  file.variables["seconds"] = std::to_string(seconds);
  std::error_code error;
  file.variables["recordings"] = std::filesystem::current_path(error).string();
  if (!request.hand.empty()) {
    file.variables["hand"] = std::filesystem::absolute(request.hand, error).string();
  }
  if (!request.host.empty()) {
    file.variables["host"] = request.host;
    // Where callers of other hosts look for it.
    file.variables["port"] = std::to_string(names::kDefaultRegistryPort);
  }
  if (is_watched) {
    file.variables["live"] = "rewrite";
    file.variables["print_token"] = "true";
  }
  const auto plan = laboratory::read_plan(path, file);
  if (!plan) return refuse_file(context, plan.error());
  if (seconds == 0) return bring_up(context, *plan, {});
  return bring_up(
      context, *plan,
      {.time = std::chrono::seconds{seconds} + kStartAndEndTime, .must_end_before = true});
}

}  // namespace

void add_demo(CLI::App& program, Context& context) {
  const auto request = std::make_shared<DemoRequest>();
  CLI::App& command = add_command(
      program, context, "demo", "Show four simulated devices and a 1 kHz force loop",
      "  rtpm demo --seconds 20\n"
      "Brings up share/rtpm/demo.toml: a registry, a server with an arm, a gaze tracker, a\n"
      "biometric sensor and a knob, a force loop that lets the arm touch a virtual wall, a "
      "console\n"
      "at the URL that it prints, for a browser, and a display of the devices' events. What the\n"
      "console records is kept in the present folder. At the end comes what the loop's calls and\n"
      "cycles took. With --host the registry is at port 7420, and asks callers of other hosts for\n"
      "keys (rtpm key).\n",
      [request](Context& c) { return demo(c, *request); });
  command
      .add_option("--seconds", request->seconds,
                  "How long; 0: until Ctrl-C. Without: 0 on a terminal, else 10")
      ->check(CLI::Range(0, 99'999))
      ->type_name("N");
  const auto check = [](const std::string& path) {
    return ::access(path.c_str(), R_OK) == 0
               ? std::string()
               : "'" + path +
                     "' of --hand is no readable file; it takes a CSV file of "
                     "t_s,x_m,y_m,z_m";
  };
  command
      .add_option("--host", request->host,
                  "Serve other hosts, too, at this address, or any; without: this host only")
      ->type_name("HOST");
  command.add_option("--hand", request->hand, "A recorded hand: CSV of t_s,x_m,y_m,z_m")
      ->check(CLI::Validator(check, ""))
      ->type_name("FILE");
}

}  // namespace rtpm::tool
