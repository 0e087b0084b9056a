#include <unistd.h>

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "loop.hpp"
#include "suite.hpp"
#include "victim.hpp"

// Servers and clients that are killed during calls.
namespace rtpm::rpc::test {
namespace {

ServerConfig config_at(std::uint16_t port) {
  ServerConfig config = quiet_config();
  config.port = port;
  return config;
}

/// A server in a process of its own, which reports its port, and then that a call is inside `hold`.
void serve_until_killed(const std::function<void(std::uint16_t)>& tell) {
  EchoServer server;
  tell(server.server->port());
  while (!await([&] { return server.servant.gate().inside_count() == 1; })) {
  }
  tell(1);
  while (true)
    pause();
}

/// Returns `method` declared idempotent, as another schema might declare it.
MethodDescriptor idempotent(MethodDescriptor method) {
  method.is_idempotent = true;
  return method;
}

}  // namespace

TEST_P(LosslessSuite, EndsTheCallInFlightWhenTheServerIsKilled) {
  Victim server(serve_until_killed);
  const std::string url = "rtpm://127.0.0.1:" + std::to_string(server.await_number()) + "/echo";
  Node node(node_config());
  auto binding = Binding::bind(node, url, echo::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  ASSERT_TRUE(binding->call(echo::kEcho, {}));
  std::thread killer([&] {
    server.await_number();
    server.kill();
  });
  expect_error(binding->call(echo::kHold, {}), CallError::kDisconnected);
  killer.join();
}

// hp-5.5-2
TEST_P(LosslessSuite, ReportsThatACallInFlightMayHaveRunWhenTheServerRestarts) {
  Victim former(serve_until_killed);
  const std::uint16_t port = former.await_number();
  Node node(node_config());
  auto binding =
      Binding::bind(node, "rtpm://127.0.0.1:" + std::to_string(port) + "/echo", echo::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  std::optional<EchoServer> server;
  std::thread restarter([&] {
    former.await_number();
    former.kill();
    server.emplace(config_at(port));
  });
  const auto reply = binding->call(echo::kHold, {});
  restarter.join();
  ASSERT_FALSE(reply);
  // Over UDP the error depends on whether the port was free for a moment.
  EXPECT_TRUE(reply.error() == CallError::kDisconnected ||
              (is_udp() && reply.error() == CallError::kPeerRestarted))
      << to_string(reply.error());
  EXPECT_EQ(server->servant.run_count(), 0) << "it is not run again";
  EXPECT_TRUE(binding->call(echo::kEchoOnce, {}));
}

TEST_P(TransportSuite, RunsAnIdempotentCallInFlightAgainWhenTheServerRestarts) {
  Victim former(serve_until_killed);
  const std::uint16_t port = former.await_number();
  Node node(node_config());
  auto binding =
      Binding::bind(node, "rtpm://127.0.0.1:" + std::to_string(port) + "/echo", echo::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  std::optional<EchoServer> server;
  std::thread restarter([&] {
    former.await_number();
    former.kill();
    server.emplace(config_at(port));
    server->servant.gate().open();
  });
  // No server has the address during the restart, which ends an attempt; a caller tries again.
  auto reply = binding->call(idempotent(echo::kHold), bytes_of("held"));
  while (!reply && reply.error() == CallError::kUnreachable) {
    reply = binding->call(idempotent(echo::kHold), bytes_of("held"));
  }
  restarter.join();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), "held");
  EXPECT_EQ(server->servant.run_count(), 1);
}

TEST_P(TransportSuite, SurvivesAClientThatIsKilledInMidCall) {
  std::optional<EchoServer> server;
  // The client is forked before there are threads and learns the address through a pipe.
  std::array<int, 2> address{};
  ASSERT_EQ(pipe(address.data()), 0);
  Victim client([&](const auto& tell) {
    std::uint16_t port = 0;
    if (read(address[0], &port, sizeof port) != sizeof port) _exit(1);
    Node node(node_config());
    auto binding =
        Binding::bind(node, "rtpm://127.0.0.1:" + std::to_string(port) + "/echo", echo::kInterface);
    if (!binding || !binding->call(echo::kEcho, {})) _exit(1);
    tell(port);
    static_cast<void>(binding->call(echo::kHold, {}));
  });
  server.emplace();
  const std::uint16_t port = server->server->port();
  ASSERT_EQ(write(address[1], &port, sizeof port), static_cast<ssize_t>(sizeof port));
  ASSERT_EQ(client.await_number(), port);
  await_inside(*server);
  client.kill();
  server->servant.gate().let_one_go();
  Node node(node_config());
  Binding binding = bind_echo(node, *server);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  if (!is_udp()) {
    EXPECT_TRUE(await([&] { return server->server->counters().connection_lost_count == 1; }));
  }
  close(address[0]);
  close(address[1]);
}

TEST_P(LosslessSuite, ReportsAKilledServerByTheDescriptor) {
  if (transport() == Transport::kLocal) GTEST_SKIP() << "it dies with its callers";
  Victim victim([](const auto& tell) {
    EchoServer server;
    tell(server.server->port());
    static_cast<void>(await([&] { return server.servant.gate().inside_count() == 1; }));
    tell(1);
    static_cast<void>(await([] { return false; }));
  });
  const std::uint16_t port = victim.await_number();
  Node node(node_config());
  auto binding = Binding::bind(node, "rtpm://127.0.0.1:" + std::to_string(port) + "/echo",
                               echo::kInterface, {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(binding) << binding.error().text();
  Loop loop;
  loop.completions.then(binding->begin(echo::kHold, {}), loop.keep());
  ASSERT_EQ(victim.await_number(), 1);
  victim.kill();
  loop.run();
  EXPECT_EQ(loop.ends, std::vector{text_of(CallError::kDisconnected)});
}

}  // namespace rtpm::rpc::test
