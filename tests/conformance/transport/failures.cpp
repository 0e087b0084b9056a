#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "suite.hpp"

// Servers and clients that end, and invalid traffic.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;
using wire::DropReason;

ServerConfig config_at(std::uint16_t port) {
  ServerConfig config = quiet_config();
  config.port = port;
  return config;
}

}  // namespace

TEST_P(LosslessSuite, GoesOnWithARestartedServer) {
  std::optional<EchoServer> server(std::in_place);
  const std::uint16_t port = server->server->port();
  Node node(node_config());
  Binding binding = bind_echo(node, *server);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  for (int restart = 0; restart < 3; ++restart) {
    server.reset();
    server.emplace(config_at(port));
    const auto reply = binding.call(echo::kEcho, bytes_of("again"));
    ASSERT_TRUE(reply) << to_string(reply.error());
    EXPECT_EQ(text_of(*reply), "again");
    EXPECT_EQ(server->servant.run_count(), 1);
  }
}

// The caller can't know whether its call ran before the server restarted.
TEST_P(LosslessSuite, ReportsARestartOnceToCallsThatMustNotRunTwice) {
  std::optional<EchoServer> server(std::in_place);
  const std::uint16_t port = server->server->port();
  Node node(node_config());
  Binding binding = bind_echo(node, *server);
  ASSERT_TRUE(binding.call(echo::kEchoOnce, {}));
  server.reset();
  server.emplace(config_at(port));
  expect_error(binding.call(echo::kEchoOnce, {}), CallError::kPeerRestarted);
  EXPECT_EQ(server->servant.run_count(), 0);
  EXPECT_TRUE(binding.call(echo::kEchoOnce, {})) << "the next call binds again";
  EXPECT_EQ(server->servant.run_count(), 1);
}

// hp-6.1-4
TEST_P(LosslessSuite, FindsItsObjectUnderAnotherNumberAfterARestart) {
  std::optional<EchoServer> first(std::in_place);
  const std::uint16_t port = first->server->port();
  Node node(node_config());
  Binding binding = bind_echo(node, *first);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  first.reset();
  echo::Servant other;
  echo::Servant servant;
  auto server = std::move(*Server::create(config_at(port)));
  ASSERT_TRUE(server->add("other", other));
  ASSERT_TRUE(server->add("echo", servant));
  ASSERT_TRUE(server->start());
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  EXPECT_EQ(other.run_count(), 0);
  EXPECT_EQ(servant.run_count(), 1);
  server->stop();
}

TEST_P(LosslessSuite, ReportsAnObjectThatIsGoneAfterARestart) {
  std::optional<EchoServer> first(std::in_place);
  const std::uint16_t port = first->server->port();
  Node node(node_config());
  Binding binding = bind_echo(node, *first);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  first.reset();
  echo::Servant other;
  auto server = std::move(*Server::create(config_at(port)));
  ASSERT_TRUE(server->add("other", other));
  ASSERT_TRUE(server->start());
  expect_error(binding.call(echo::kEcho, {}), CallError::kNoSuchObject);
  EXPECT_EQ(other.run_count(), 0);
  server->stop();
}

TEST_P(LosslessSuite, ReportsAServerThatIsGone) {
  std::optional<EchoServer> server(std::in_place);
  Node node(node_config());
  Binding binding = bind_echo(node, *server);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  server.reset();
  expect_error(binding.call(echo::kEcho, {}), CallError::kUnreachable);
  expect_error(binding.call(echo::kEchoOnce, {}), CallError::kUnreachable);
}

TEST_P(LosslessSuite, FinishesTheCallThatRunsWhenTheServerStops) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::thread caller([&] {
    const auto reply = binding.call(echo::kHold, bytes_of("held"));
    ASSERT_TRUE(reply) << to_string(reply.error());
    EXPECT_EQ(text_of(*reply), "held");
  });
  await_inside(server);
  std::thread stopper([&] { server.server->stop(); });
  server.servant.gate().let_one_go();
  stopper.join();
  caller.join();
}

TEST_P(LosslessSuite, EndsCallsThatWaitWhenTheServerStops) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  {
    const auto first = binding.call(echo::kEcho, {});
    const auto second = binding.call(echo::kEcho, {});
    ASSERT_TRUE(first && second);
  }
  std::thread running([&] { EXPECT_TRUE(binding.call(echo::kHold, {})); });
  await_inside(server);
  std::atomic<bool> has_stopped{false};
  std::thread waiting([&] {
    const auto reply = binding.call(echo::kEchoOnce, {}, {.deadline = rtpm::test::kPatience});
    // The lane may have received it before it stopped.
    EXPECT_TRUE(reply || reply.error() == CallError::kStopped) << to_string(reply.error());
  });
  std::thread stopper([&] {
    server.server->stop();
    has_stopped = true;
  });
  server.servant.gate().let_one_go();
  stopper.join();
  running.join();
  waiting.join();
  EXPECT_TRUE(has_stopped);
}

TEST_P(LosslessSuite, ReportsAStoppedServerAsUnreachable) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  server.server->stop();
  expect_error(binding.call(echo::kEcho, {}), CallError::kUnreachable);
}

TEST_P(WireSuite, CountsGarbageByItsReasonAndGoesOn) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  struct Spoiling {
    std::size_t offset;
    std::byte value;
    DropReason reason;
  };
  std::uint64_t count = 0;
  for (const Spoiling& spoiling : {Spoiling{0, std::byte{0}, DropReason::kBadMagic},
                                   Spoiling{2, std::byte{2}, DropReason::kBadVersion},
                                   Spoiling{3, std::byte{12}, DropReason::kBadKind},
                                   Spoiling{5, std::byte{0x80}, DropReason::kBadPriority},
                                   Spoiling{6, std::byte{16}, DropReason::kReservedSet},
                                   Spoiling{34, std::byte{2}, DropReason::kBadFragment}}) {
    RawPeer peer(transport(), server.server->port());
    Bytes frame = peer.call_frame(1, echo::kEcho.id);
    frame[spoiling.offset] = spoiling.value;
    peer.send(frame);
    ++count;
    EXPECT_TRUE(await([&] {
      return server.server->counters().frames.dropped_for(spoiling.reason) == 1;
    })) << to_string(spoiling.reason);
    if (!is_udp()) {
      EXPECT_EQ(peer.receive(), std::nullopt);
      EXPECT_TRUE(peer.is_closed()) << "nobody knows where the next frame would begin";
    }
    EXPECT_TRUE(binding.call(echo::kEcho, {}));
  }
  std::uint64_t dropped_count = 0;
  for (const std::uint64_t one : server.server->counters().frames.dropped)
    dropped_count += one;
  EXPECT_EQ(dropped_count, count) << "each under one reason";
  EXPECT_TRUE(await(
      [&] { return server.server->counters().connection_lost_count == (is_udp() ? 0 : count); }));
}

TEST_P(WireSuite, RefusesCallsWithoutASession) {
  EchoServer server;
  RawPeer peer(transport(), server.server->port());
  peer.send(peer.call_frame(5, echo::kEcho.id));
  const auto answer = peer.receive_answer(5);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->kind, wire::FrameKind::kRefuse);
  EXPECT_EQ(answer->status, wire::Status::kUnknownSession);
  EXPECT_EQ(server.servant.run_count(), 0);
}

// hp-4.4-4: over UDP the kernel gives the frame to another lane, which must not make the client
// believe that its session is lost.
TEST_P(WireSuite, LosesNoSessionInAnotherLane) {
  EchoServer server(quiet_config({quiet_lane(0), quiet_lane(10'000)}));
  RawPeer peer(transport(), server.server->port(), 100);
  ASSERT_TRUE(peer.open());
  const auto call_at = [&](std::uint32_t call_id, Priority priority) {
    Bytes frame = peer.call_frame(call_id, echo::kEcho.id);
    store_le(frame.data() + 4, priority.value());
    peer.send(frame);
    return peer.receive_answer(call_id);
  };
  const auto refused = call_at(1, 20'000);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->kind, is_udp() ? wire::FrameKind::kRefuse : wire::FrameKind::kReply);
  EXPECT_EQ(refused->status, wire::Status::kWrongBand);
  const auto answer = call_at(2, 100);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, wire::Status::kOk);
  EXPECT_EQ(server.servant.run_count(), 1);
}

// hp-6.2-1
TEST_P(WireSuite, AnswersAPingAboveTheCeiling) {
  ServerConfig config = quiet_config();
  config.ceiling = 20'000;
  EchoServer server(config);
  RawPeer peer(transport(), server.server->port(), 30'000);
  ASSERT_TRUE(peer.open());
  const auto status_of = [&](std::uint32_t call_id, std::uint16_t method, std::string_view text) {
    peer.send(peer.call_frame(call_id, method, text, wire::kSessionService));
    const auto answer = peer.receive_answer(call_id);
    return answer ? answer->status : wire::Status::kExpired;
  };
  EXPECT_EQ(status_of(1, wire::kMethodPing, ""), wire::Status::kOk);
  EXPECT_EQ(status_of(2, wire::kMethodPing, "a payload"), wire::Status::kOk);
  EXPECT_EQ(status_of(3, wire::kMethodBind, ""), wire::Status::kPriorityNotAllowed);
}

TEST_P(WireSuite, SurvivesRandomBytes) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::mt19937_64 random(1);
  for (int round = 0; round < 100; ++round) {
    RawPeer peer(transport(), server.server->port());
    Bytes noise(random() % 1500);
    for (std::byte& byte : noise)
      byte = static_cast<std::byte>(random());
    // Some of the frames begin like a header.
    if (random() % 2 == 0) {
      const Bytes frame = peer.call_frame(1, 1, std::string(random() % 100, 'x'));
      std::copy_n(frame.begin(), std::min(frame.size(), noise.size()), noise.begin());
    }
    if (!noise.empty()) peer.send(noise);
    ASSERT_TRUE(binding.call(echo::kEcho, {}));
  }
}

TEST_P(WireSuite, AnswersUnreadableRequestsToTheSessionItself) {
  EchoServer server;
  RawPeer peer(transport(), server.server->port());
  ASSERT_TRUE(peer.open());
  peer.send(peer.call_frame(1, wire::kMethodBind, "not a bind", 0));
  auto answer = peer.receive_answer(1);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, wire::Status::kBadRequest);
  peer.send(peer.call_frame(2, 99, "", 0));
  answer = peer.receive_answer(2);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, wire::Status::kNoSuchMethod);
  peer.send(peer.call_frame(3, 1, "", 99));
  answer = peer.receive_answer(3);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, wire::Status::kNoSuchObject);
}

TEST_P(WireSuite, RefusesSessionsBeyondItsLimit) {
  ServerConfig config = quiet_config();
  config.session_count_max = 2;
  EchoServer server(config);
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < 2; ++i) {
    peers.push_back(std::make_unique<RawPeer>(transport(), server.server->port()));
    EXPECT_TRUE(peers.back()->open());
  }
  RawPeer one_more(transport(), server.server->port());
  EXPECT_FALSE(one_more.open());
  peers[0]->send(peers[0]->call_frame(1, echo::kEcho.id));
  EXPECT_TRUE(peers[0]->receive_answer(1)) << "the others go on";
}

}  // namespace rtpm::rpc::test
