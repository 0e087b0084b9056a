// rtpm-console: serves a page that shows and operates the system in browsers, and speaks the
// Foxglove WebSocket protocol.
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "configuration.hpp"
#include "console.hpp"
#include "page_folder.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "web/server.hpp"
#include "web/token.hpp"

namespace rtpm::console {
namespace {

int fail(const SetupError& error) {
  rt::print_error("rtpm-console", error.text());
  return 1;
}

int serve(Configuration configuration) {
  // Before any thread, which would else be ended by the signal.
  const options::StopSignal stop;
  if (configuration.token.empty()) {
    auto token = make_token();
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
                .is_read_only = configuration.is_read_only};
  auto created = WebServer::create(std::move(web), console);
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
  const std::string suffix = configuration.is_read_only ? "" : "?token=" + configuration.token;
  std::printf("serving %s%s\n", server->url().c_str(), suffix.c_str());
  std::fflush(stdout);

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
