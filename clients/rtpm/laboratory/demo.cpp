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
#include "cli/kept_folder.hpp"
#include "cli/output.hpp"
#include "laboratory/commands.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::tool {
namespace {

/// The console's port, if free.
constexpr std::uint16_t kConsolePort = 8766;
/// The demo's length without a terminal, where Ctrl-C can't be pressed.
constexpr int kSecondsWithoutTerminal = 10;

struct DemoRequest {
  std::optional<int> seconds{};  ///< 0 to run until Ctrl-C.
  std::string hand{};
  std::string host{};
};

/// Whether a server can listen at this port on this host.
bool is_free(std::uint16_t port) {
  const transport::Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int yes = 1;
  ::setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const sockaddr_in address{.sin_family = AF_INET,
                            .sin_port = htons(port),
                            .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)},
                            .sin_zero = {}};
  const auto* const at = reinterpret_cast<const sockaddr*>(&address);
  return ::bind(socket.number(), at, sizeof address) == 0 && ::listen(socket.number(), 1) == 0;
}

int demo(Context& context, const DemoRequest& request) {
  const std::string path = laboratory::program_folders().front() + "/../share/rtpm/demo.toml";
  const bool is_watched = is_terminal() && !context.json;
  std::error_code error;
  laboratory::Variables variables{
      {"seconds",
       std::to_string(request.seconds.value_or(is_watched ? 0 : kSecondsWithoutTerminal))},
      {"recordings", std::filesystem::current_path(error).string()},
      {"live", is_watched ? "rewrite" : "lines"},
      {"print_token", is_watched ? "true" : "false"}};
  if (!request.hand.empty())
    variables["hand"] = std::filesystem::absolute(request.hand, error).string();
  if (!request.host.empty()) {
    variables["host"] = request.host;
    // The port at which callers on other hosts look for it.
    variables["port"] = std::to_string(names::kDefaultRegistryPort);
  }
  // The console has the same URL at each start, so that a bookmark works.
  if (is_free(kConsolePort)) variables["console_port"] = std::to_string(kConsolePort);
  if (const std::string folder = kept_folder(); !folder.empty()) {
    variables["token_file"] = folder + "/demo-console.token";
  } else {
    rt::print_error("rtpm",
                    "the console's token is a new one at each start: no folder ~/.local/state/rtpm "
                    "or $XDG_STATE_HOME/rtpm can keep it");
  }
  return bring_up(context, laboratory::read_plan(path, variables));
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
