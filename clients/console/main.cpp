// rtpm-console: serves a page for showing and operating the system in browsers, and the Foxglove
// WebSocket protocol.
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "configuration.hpp"
#include "console.hpp"
#include "page_folder.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "web/host_name.hpp"
#include "web/server.hpp"
#include "web/token.hpp"

namespace rtpm::console {
namespace {

int fail(const SetupError& error) {
  rt::print_error("rtpm-console", error.text());
  return 1;
}

/// Prints the page's address. The token is only printed to a terminal: other output may be stored
/// in a file, readable by people who may not command.
void print_urls(const Configuration& configuration, const WebServer& server) {
  const bool has_token = !configuration.is_read_only;
  const bool prints_token =
      has_token && (configuration.prints_token || ::isatty(STDOUT_FILENO) == 1);
  const std::string suffix = prints_token ? "?token=" + configuration.token : "";
  std::string text = "serving " + server.url() + suffix + "\n";
  if (configuration.address == "0.0.0.0" || configuration.address == "::") {
    text += "for other hosts: http://" + host_name() + ":" + std::to_string(server.port()) + "/" +
            suffix + "\n";
  }
  if (has_token && !prints_token && !configuration.token_file.empty()) {
    text += "to command, append ?token= and the text in " + configuration.token_file + "\n";
  } else if (has_token && !prints_token) {
    text += "to command, start it on a terminal, or with --token-file FILE\n";
  }
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

int serve(Configuration configuration) {
  // Created before any thread, so that all threads inherit its blocked signals.
  const program::StopSignal stop;
  if (configuration.token.empty()) {
    auto token =
        configuration.token_file.empty() ? make_token() : token_in_file(configuration.token_file);
    if (!token) return fail(token.error());
    configuration.token = std::move(*token);
  }
  rpc::Node node(
      {.wait = {.strategy = rt::WaitStrategy::kBlock}, .security = configuration.security});
  names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);

  WebServer* server = nullptr;
  Console console(node, configuration,
                  [&server](std::function<void()> work) { server->post(std::move(work)); });
  WebConfig web{.address = configuration.address,
                .port = configuration.port,
                .page_folder = configuration.page.empty()
                                   ? default_page_folder()
                                   : std::filesystem::path(configuration.page),
                .token = configuration.token,
                .is_read_only = configuration.is_read_only,
                .host_names = configuration.host_names};
  if (!is_loopback(configuration.address)) web.host_names.push_back(host_name());
  auto created = WebServer::create(std::move(web), console, console, console);
  if (!created) return fail(created.error());
  server = created->get();
  const auto started = console.start([server](Duration period, std::function<void()> work) {
    server->every(period, std::move(work));
  });
  if (!started) {
    console.stop();
    return fail(started.error());
  }
  auto thread = rt::Thread::start({.name = "console-web", .realtime = rt::RealtimeMode::kOff},
                                  [server] { server->run(); });
  if (!thread) {
    console.stop();
    return fail(thread.error());
  }
  print_urls(configuration, *server);

  if (configuration.seconds > 0) {
    static_cast<void>(stop.wait_for(std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(configuration.seconds))));
  } else {
    stop.wait();
  }
  server->stop();
  thread->join();
  console.stop();
  return 0;
}

}  // namespace
}  // namespace rtpm::console

int main(int argc, char** argv) {
  rtpm::console::Configuration configuration;
  if (const auto exit_code = rtpm::console::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::console::serve(std::move(configuration));
}
