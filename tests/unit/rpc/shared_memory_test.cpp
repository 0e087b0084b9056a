#include "rtpm/transport/shared_memory.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <thread>
#include <vector>

#include "../transport/raw_shared_client.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/temporary_folder.hpp"

// Servers and callers on shared memory, beyond the guarantees of every transport
// (tests/conformance/transport).
namespace rtpm::rpc {
namespace {

// Makes the node treat the server as another program.
NodeConfig apart(Transport transport) {
  NodeConfig config = test::quiet_node(transport);
  config.collocates = false;
  return config;
}

using namespace test;
namespace fs = std::filesystem;

std::string memory_name(const EchoServer& server) {
  return "rtpm/127.0.0.1:" + std::to_string(server.server->port());
}

TEST(SharedMemoryChoice, IsTheDefaultOnOneHost) {
  EchoServer server;
  Node node(apart(Transport::kAuto));
  Binding binding = bind_echo(node, server);
  EXPECT_EQ(binding.transport(), Transport::kSharedMemory);
  const auto reply = binding.call(echo::kEcho, bytes_of("through memory"));
  ASSERT_TRUE(reply);
  EXPECT_EQ(text_of(*reply), "through memory");
  EXPECT_TRUE(await([&] { return server.server->counters().connection_count == 1; }));
}

TEST(SharedMemoryChoice, FallsBackToUdpIfTheServerHasNone) {
  ServerConfig config = quiet_config();
  config.shared_memory = false;
  EchoServer server(config);
  Node node(apart(Transport::kAuto));
  Binding binding = bind_echo(node, server);
  EXPECT_EQ(binding.transport(), Transport::kUdp);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  Node strict(quiet_node(Transport::kSharedMemory));
  const auto none = Binding::bind(strict, server.url(), echo::kInterface);
  ASSERT_FALSE(none);
  expect_text(none.error().text(), {"'echo'", "gives no shared memory", "Remedy"});
}

TEST(SharedMemoryChoice, FindsServersInAFolderAndOutsideOfIt) {
  const rtpm::test::TemporaryFolder folder;
  const std::string& name = folder.path();
  {
    ServerConfig config = quiet_config();
    config.shared_memory_folder = name;
    EchoServer server(config);
    Node stranger(apart(Transport::kAuto));
    EXPECT_EQ(bind_echo(stranger, server).transport(), Transport::kUdp);
    NodeConfig knowing = apart(Transport::kAuto);
    knowing.shared_memory_folder = name;
    Node node(knowing);
    Binding binding = bind_echo(node, server);
    EXPECT_EQ(binding.transport(), Transport::kSharedMemory);
    EXPECT_TRUE(binding.call(echo::kEcho, {}));
    EchoServer other;
    EXPECT_EQ(bind_echo(node, other).transport(), Transport::kSharedMemory);
  }
  EXPECT_TRUE(fs::is_empty(name));
}

TEST(SharedMemoryChoice, ReportsANameThatIsInUse) {
  EchoServer server;
  const auto other = transport::SharedMemoryListener::open(
      {"127.0.0.1", static_cast<std::uint16_t>(server.server->port() ^ 1)});
  if (!other) GTEST_SKIP() << "the neighbouring port is in use";
  ServerConfig config = quiet_config();
  config.port = static_cast<std::uint16_t>(server.server->port() ^ 1);
  const auto created = Server::create(config);
  ASSERT_FALSE(created);
  expect_text(created.error().text(), {"server 'test'", "Remedy"});
}

TEST(SystemWithoutSharedMemory, RefusesCallersAndServersThatAskForIt) {
  if (transport::offers_shared_memory()) GTEST_SKIP() << "this system offers shared memory";
  EchoServer server;
  Node node(apart(Transport::kAuto));
  EXPECT_EQ(bind_echo(node, server).transport(), Transport::kUdp);
  Node strict(quiet_node(Transport::kSharedMemory));
  const auto bound = Binding::bind(strict, server.url(), echo::kInterface);
  ASSERT_FALSE(bound);
  expect_text(bound.error().text(),
              {"'echo' can't be bound", "offers no calls through shared memory",
               "Remedy: call over UDP or TCP"});
  ServerConfig config = quiet_config();
  config.shared_memory_folder = "/run/lab";
  const auto created = Server::create(config);
  ASSERT_FALSE(created);
  expect_text(created.error().text(), {"server 'test'", "offers no shared memory", "'/run/lab'",
                                       "Remedy: leave the folder out"});
}

// hp-16.2-2
TEST(SharedMemoryLane, CountsAPeerThatWritesInvalidWords) {
  EchoServer server;
  Node node(quiet_node(Transport::kSharedMemory));
  Binding binding = bind_echo(node, server);
  transport::Descriptor socket = transport::test::connect_to_name(memory_name(server));
  ASSERT_TRUE(socket.is_open());
  transport::test::write_all(socket, transport::test::request_of(0));
  auto answer = transport::test::take_message(socket.number());
  const transport::test::RawMemory memory(std::move(answer.descriptor), 128 * 1024);
  ASSERT_TRUE(await([&] { return server.server->counters().connection_count == 2; }));
  memory.to_server_tail() = 12'345;
  // The lane sleeps, so it needs a wake-up.
  transport::test::write_all(socket, Bytes(1));
  EXPECT_TRUE(await([&] { return server.server->counters().broken_memory_count == 1; }));
  EXPECT_TRUE(await([&] { return server.server->counters().connection_lost_count == 1; }));
  EXPECT_TRUE(transport::test::take_message(socket.number()).bytes.empty()) << "it hangs up";
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

// hp-16.4-2
TEST(SharedMemoryLane, DisconnectsACallerThatDoesNotReadItsReplies) {
  EchoServer server;
  Node node(quiet_node(Transport::kSharedMemory));
  Binding binding = bind_echo(node, server);
  RawPeer peer(Transport::kSharedMemory, server.server->port());
  ASSERT_TRUE(peer.open());
  // Twelve such replies fill a ring of 128 KiB, so that a further one does not fit.
  const std::string large(10'000, 'x');
  for (std::uint32_t call = 1; call <= 13; ++call) {
    EXPECT_EQ(server.server->counters().send_failure_count, 0u);
    peer.send(peer.call_frame(call, echo::kEcho.id, large));
    ASSERT_TRUE(await([&] { return server.servant.run_count() == static_cast<int>(call); }));
  }
  EXPECT_TRUE(await([&] { return server.server->counters().send_failure_count == 1; }));
  EXPECT_TRUE(await([&] { return server.server->counters().connection_lost_count == 1; }));
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

// One lane serves memory, datagrams and streams together, in any waiting mode, and skips no caller.
TEST(SharedMemoryLane, ServesCallersOfAllTransportsTogether) {
  for (const rt::WaitStrategy wait :
       {rt::WaitStrategy::kBlock, rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kSpin}) {
    LaneConfig lane;
    lane.wait.strategy = wait;
    EchoServer server(quiet_config({lane}));
    std::atomic<int> wrong_count{0};
    std::vector<std::thread> callers;
    for (const Transport transport :
         {Transport::kUdp, Transport::kTcp, Transport::kSharedMemory, Transport::kSharedMemory}) {
      callers.emplace_back([&, transport] {
        Node node(quiet_node(transport));
        Binding binding = bind_echo(node, server);
        for (int i = 0; i < 300; ++i) {
          const std::string text = std::to_string(i);
          const auto reply = binding.call(echo::kEchoOnce, bytes_of(text));
          if (!reply || text_of(*reply) != text) ++wrong_count;
        }
      });
    }
    for (std::thread& caller : callers)
      caller.join();
    EXPECT_EQ(wrong_count, 0);
    EXPECT_EQ(server.servant.run_count(), 4 * 300);
  }
}

// Callers come and go while the lane sleeps and wakes.
TEST(SharedMemoryLane, ServesCallersThatComeAndGo) {
  EchoServer server;
  std::vector<std::thread> callers;
  for (int number = 0; number < 4; ++number) {
    callers.emplace_back([&] {
      for (int life = 0; life < 20; ++life) {
        Node node(quiet_node(Transport::kSharedMemory));
        Binding binding = bind_echo(node, server);
        for (int i = 0; i < 10; ++i)
          ASSERT_TRUE(binding.call(echo::kEcho, {}));
      }
    });
  }
  for (std::thread& caller : callers)
    caller.join();
  EXPECT_TRUE(await([&] { return server.server->counters().connection_lost_count == 80; }));
  EXPECT_EQ(server.server->counters().broken_memory_count, 0u);
}

}  // namespace
}  // namespace rtpm::rpc
