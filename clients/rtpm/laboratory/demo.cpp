#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "laboratory/bring_up.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/file.hpp"
#include "laboratory/process.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

constexpr const char* kFile = "demo.toml";
/// The console's port, if it is free.
constexpr std::uint16_t kConsolePort = 8766;
/// Time for start and end, added to the programs' own.
constexpr Duration kStartAndEndTime = std::chrono::seconds{15};
/// The demo's length without a terminal, where nobody can press Ctrl-C.
constexpr int kSecondsWithoutTerminal = 10;

struct DemoRequest {
  std::optional<int> seconds{};  ///< 0: until Ctrl-C.
  std::string hand{};
  std::string host{};
};

/// Whether a server can listen at this port of this host.
bool is_free(std::uint16_t port) {
  const laboratory::Handle socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int yes = 1;
  ::setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto* const at = static_cast<const sockaddr*>(static_cast<const void*>(&address));
  return ::bind(socket.number(), at, sizeof address) == 0 && ::listen(socket.number(), 1) == 0;
}

/// The user's folder for persistent files; empty if there is none.
std::string kept_folder() {
  const char* const state = std::getenv("XDG_STATE_HOME");
  const char* const home = std::getenv("HOME");
  std::filesystem::path folder;
  if (state != nullptr && *state == '/') {
    folder = state;
  } else if (home != nullptr && *home == '/') {
    folder = std::filesystem::path(home) / ".local/state";
  } else {
    return {};
  }
  folder /= "rtpm";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  return error ? std::string() : folder.string();
}

/// Serves the console at the same URL at each start, so that a bookmark works.
void keep_url(laboratory::FileContext& file) {
  if (is_free(kConsolePort)) file.variables["console_port"] = std::to_string(kConsolePort);
  if (const std::string folder = kept_folder(); !folder.empty()) {
    file.variables["token_file"] = folder + "/demo-console.token";
  } else {
    rt::print_error("rtpm",
                    "the console's token is a new one at each start: there is no folder "
                    "~/.local/state/rtpm or $XDG_STATE_HOME/rtpm to keep it in");
  }
}

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
    // The port at which callers of other hosts look for it.
    file.variables["port"] = std::to_string(names::kDefaultRegistryPort);
  }
  if (is_watched) {
    file.variables["live"] = "rewrite";
    file.variables["print_token"] = "true";
  }
  keep_url(file);
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
      "for a browser, at port 8766 if that is free, and a display of the devices' events. The\n"
      "console's token is the same at each start, kept in ~/.local/state/rtpm. What it records is\n"
      "kept in the present folder. At the end comes what the loop's calls and cycles took. With\n"
      "--host the registry is at port 7420, and asks callers of other hosts for keys (rtpm key).\n",
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
