#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "deferring_servant.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/other_hosts.hpp"
#include "rtpm/wire/limits.hpp"

// The share of a server that one host, or one process, can take, over real sockets.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

sockaddr_in loopback(const char* host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, host, &address.sin_addr);
  return address;
}

/// A TCP connection from one of this host's addresses.
transport::Descriptor connect_from(const char* host, std::uint16_t port) {
  transport::Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const sockaddr_in own = loopback(host, 0);
  const sockaddr_in server = loopback("127.0.0.1", port);
  EXPECT_EQ(bind(socket.number(), reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
  EXPECT_EQ(connect(socket.number(), reinterpret_cast<const sockaddr*>(&server), sizeof server), 0);
  const timeval patience{20, 0};
  setsockopt(socket.number(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  return socket;
}

/// One of many addresses from which any program of this host may call, such as "127.0.5.7".
std::string of_loopback(int index) {
  return "127.0." + std::to_string(index / 250) + "." + std::to_string(index % 250 + 1);
}

transport::Descriptor connect_to_memory(std::uint16_t port) {
  transport::Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  const std::string name = "rtpm/127.0.0.1:" + std::to_string(port);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  EXPECT_EQ(connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), size), 0);
  return socket;
}

/// The server's answer to a HELLO on the connection.
wire::Header answer_to_hello(int socket) {
  std::array<std::byte, wire::kHeaderSize + wire::Hello::kSize> frame{};
  wire::Header header;
  header.kind = wire::FrameKind::kHello;
  header.call_id = 7;
  header.payload_size = header.message_size = wire::Hello::kSize;
  encode(header, frame.data());
  wire::Hello hello;
  hello.client_epoch = 5;
  hello.message_size_max = 4096;
  encode(hello, MutableBytes(frame).subspan(wire::kHeaderSize));
  static_cast<void>(::send(socket, frame.data(), frame.size(), MSG_NOSIGNAL));
  std::array<std::byte, wire::kHeaderSize> answer{};
  if (recv(socket, answer.data(), answer.size(), MSG_WAITALL) != wire::kHeaderSize) return {};
  return wire::decode(answer).value_or(wire::Header{});
}

ServerConfig small_config(std::uint32_t session_count_max) {
  ServerConfig config = quiet_config();
  config.session_count_max = session_count_max;
  return config;
}

// hp-4-8: many silent connections do not keep other hosts out, or push out their connections.
TEST(Newcomers, ThatStaySilentDoNotBlockOthers) {
  const rtpm::test::OtherHosts hosts;
  if (!hosts.is_there()) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  EchoServer server;
  const std::uint16_t port = server.server->port();
  const transport::Descriptor patient = connect_from("10.77.0.2", port);
  std::vector<transport::Descriptor> silent;
  for (int i = 0; i < 300; ++i)
    silent.push_back(connect_from(of_loopback(i).c_str(), port));
  for (int i = 0; i < 10; ++i) {
    const transport::Descriptor next = connect_from("127.0.0.1", port);
    EXPECT_EQ(answer_to_hello(next.number()).kind, wire::FrameKind::kWelcome) << i;
  }
  EXPECT_EQ(answer_to_hello(patient.number()).kind, wire::FrameKind::kWelcome);
}

// hp-4-8: silent clients of shared memory do not, either, and TCP connections do not affect it.
TEST(Newcomers, ThatStaySilentDoNotBlockSharedMemory) {
  EchoServer server;
  const std::uint16_t port = server.server->port();
  std::vector<transport::Descriptor> silent;
  for (int i = 0; i < 200; ++i) {
    silent.push_back(connect_to_memory(port));
    silent.push_back(connect_from("127.0.0.1", port));
  }
  Node node(quiet_node(Transport::kSharedMemory));
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("here")));
}

// hp-4-7: a host may have three quarters of the connections, and is refused when it reaches them.
TEST(Connections, OfOneHostAreLimited) {
  const rtpm::test::OtherHosts hosts;
  if (!hosts.is_there()) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  EchoServer server(small_config(8));
  const std::uint16_t port = server.server->port();
  std::vector<transport::Descriptor> taken;
  for (int i = 0; i < 6; ++i) {
    taken.push_back(connect_from(of_loopback(i).c_str(), port));
    EXPECT_EQ(answer_to_hello(taken.back().number()).kind, wire::FrameKind::kWelcome) << i;
  }
  const transport::Descriptor next = connect_from("127.9.9.9", port);
  const wire::Header refusal = answer_to_hello(next.number());
  EXPECT_EQ(refusal.kind, wire::FrameKind::kRefuse);
  EXPECT_EQ(refusal.status, wire::Status::kOverload);
  EXPECT_EQ(refusal.call_id, 7u);
  for (int i = 0; i < 2; ++i) {
    taken.push_back(connect_from("10.77.0.2", port));
    EXPECT_EQ(answer_to_hello(taken.back().number()).kind, wire::FrameKind::kWelcome) << i;
  }
  EXPECT_EQ(answer_to_hello(connect_from("10.77.0.2", port).number()).status,
            wire::Status::kOverload);
  EXPECT_TRUE(await([&] { return server.server->counters().connection_refused_count == 2; }));
  // A connection that ends frees a slot.
  taken.erase(taken.begin());
  EXPECT_TRUE(await([&] {
    const transport::Descriptor again = connect_from("127.0.0.1", port);
    return answer_to_hello(again.number()).kind == wire::FrameKind::kWelcome;
  }));
}

// hp-4-7: a process may have no more than its share, and does not keep other processes out.
TEST(Connections, OfOneProcessAreLimited) {
  EchoServer server(small_config(4));
  const std::uint16_t port = server.server->port();
  std::vector<std::unique_ptr<RawPeer>> taken;
  for (int i = 0; i < 3; ++i) {
    taken.push_back(std::make_unique<RawPeer>(Transport::kSharedMemory, port));
    EXPECT_TRUE(taken.back()->open()) << i;
  }
  RawPeer next(Transport::kSharedMemory, port);
  EXPECT_FALSE(next.open());
  const auto other = rtpm::test::run_in_child([&] {
    RawPeer peer(Transport::kSharedMemory, port);
    return std::string(peer.open() ? "served" : "not served");
  });
  EXPECT_EQ(other.said, "served");
}

// A connection whose first frame opens no session counts as silent.
TEST(Connections, WithoutASessionAreReplaced) {
  EchoServer server(small_config(1));
  const std::uint16_t port = server.server->port();
  const transport::Descriptor stray = connect_from("127.0.0.1", port);
  std::array<std::byte, wire::kHeaderSize> frame{};
  wire::Header header;
  header.session = 5;
  encode(header, frame.data());
  ASSERT_EQ(::send(stray.number(), frame.data(), frame.size(), 0), wire::kHeaderSize);
  ASSERT_EQ(recv(stray.number(), frame.data(), frame.size(), MSG_WAITALL), wire::kHeaderSize);
  EXPECT_EQ(wire::decode(frame)->status, wire::Status::kUnknownSession);
  transport::Descriptor next;
  EXPECT_TRUE(await([&] {
    next = connect_from("127.0.0.1", port);
    return answer_to_hello(next.number()).kind == wire::FrameKind::kWelcome;
  }));
  EXPECT_EQ(recv(stray.number(), frame.data(), frame.size(), 0), 0) << "it was ended";
  // A connection with a session stays.
  EXPECT_EQ(answer_to_hello(connect_from("127.0.0.1", port).number()).status,
            wire::Status::kOverload);
}

// hp-4.4-5
TEST(Strangers, AreAnsweredAtALimitedRate) {
  EchoServer server;
  RawPeer stranger(Transport::kUdp, server.server->port());
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const MonotonicTime begin = rt::now();
  constexpr std::uint32_t kFrameCount = 20'000;
  for (std::uint32_t i = 0; i < kFrameCount; ++i)
    stranger.send(stranger.call_frame(i, echo::kEcho.id));
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("here")));
  const auto counters = server.server->counters().frames;
  const auto more = static_cast<std::uint64_t>((rt::now() - begin) / wire::kStrangerAnswerInterval);
  EXPECT_GT(counters.refused_count, 0u);
  EXPECT_LE(counters.refused_count, wire::kStrangerAnswerBurst + more + 1);
  EXPECT_EQ(counters.refused_count, counters.dropped_for(wire::DropReason::kUnknownSession));
}

/// A server with two buffers for large messages, both of which are taken.
class LargeMessages : public testing::Test {
 protected:
  static constexpr std::uint32_t kSize = 5000;

  static ServerConfig config(std::uint32_t deferred_count_max = 32) {
    ServerConfig config = quiet_config();
    config.large_message_count_max = 2;
    config.deferred_call_count_max = deferred_count_max;
    return config;
  }
  /// Makes the servant produce two replies that are never fetched.
  static void take_buffers(EchoServer& server, RawPeer& peer) {
    ASSERT_TRUE(peer.open());
    for (std::uint32_t call_id = 1; call_id <= 2; ++call_id) {
      std::string size(sizeof kSize, '\0');
      std::memcpy(size.data(), &kSize, sizeof kSize);
      peer.send(peer.call_frame(call_id, echo::kGrow.id, size));
    }
    ASSERT_TRUE(await([&] { return server.servant.run_count() == 2; }));
  }
  static auto grow(Binding& binding, Duration deadline = rtpm::test::kPatience) {
    return binding.call(echo::kGrow, std::as_bytes(std::span(&kSize, 1)), {.deadline = deadline});
  }
};

// hp-5.6-5, hp-5.6-10: a finished reply is not lost for lack of a buffer; it waits until the server
// evicts one that is not fetched.
TEST_F(LargeMessages, WaitForABufferAfterTheyRan) {
  EchoServer server(config());
  RawPeer silent(Transport::kUdp, server.server->port());
  take_buffers(server, silent);
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  std::thread caller([&] {
    const auto reply = grow(binding);
    ASSERT_TRUE(reply) << to_string(reply.error());
    EXPECT_EQ(reply->bytes().size(), kSize);
  });
  ASSERT_TRUE(await([&] { return server.servant.run_count() == 3; }));
  // Meanwhile the server answers small calls as usual.
  const auto small = binding.call(echo::kEcho, bytes_of("small"));
  ASSERT_TRUE(small);
  EXPECT_EQ(text_of(*small), "small");
  caller.join();
  EXPECT_EQ(server.servant.run_count(), 4) << "each ran once";
  // A lane publishes its counters after it has sent the reply.
  EXPECT_TRUE(await([&] { return server.server->counters().frames.large_evicted_count == 1; }));
}

// A caller with a shorter deadline gets no answer, and leaves nothing behind.
TEST_F(LargeMessages, WaitNoLongerThanTheirCallers) {
  EchoServer server(config(1));
  RawPeer silent(Transport::kUdp, server.server->port());
  take_buffers(server, silent);
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  for (int i = 0; i < 3; ++i) {
    const auto reply = grow(binding, 100ms);
    ASSERT_FALSE(reply);
    EXPECT_TRUE(reply.error() == CallError::kTimeout || reply.error() == CallError::kOverload)
        << to_string(reply.error());
  }
  EXPECT_TRUE(await([&] { return server.server->counters().late_count >= 1; }));
  EXPECT_TRUE(grow(binding)) << "the slot of the waiting reply is free again";
}

// A cancelled call must not leave the lane with a wake-up time at which there is nothing to do.
TEST_F(LargeMessages, LetTheLaneSleepAfterACancel) {
  EchoServer server(config());
  RawPeer silent(Transport::kUdp, server.server->port());
  take_buffers(server, silent);
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  {
    const auto pending = binding.begin(echo::kGrow, std::as_bytes(std::span(&kSize, 1)));
    ASSERT_TRUE(pending);
    ASSERT_TRUE(await([&] { return server.servant.run_count() == 3; }));
  }
  // Waits past the time when a buffer would have been free.
  const MonotonicTime end = rt::now() + wire::kLargeMessageSilenceMax + 100ms;
  ASSERT_TRUE(await([&] { return rt::now() >= end; }));
  EXPECT_TRUE(await([] {
    const Duration before = rtpm::test::process_cpu_time();
    rt::sleep_until(rt::now() + 100ms);
    return rtpm::test::process_cpu_time() - before < 20ms;
  })) << "a thread is always busy";
}

// If a reply could not wait either, the server refuses the call before it runs.
TEST_F(LargeMessages, AreRefusedBeforeTheyRun) {
  EchoServer server(config(0));
  RawPeer silent(Transport::kUdp, server.server->port());
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  take_buffers(server, silent);
  const auto reply = grow(binding);
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kOverload);
  EXPECT_EQ(server.servant.run_count(), 2);
  EXPECT_TRUE(await([&] { return server.server->counters().overload_count == 1; }));
  EXPECT_TRUE(await([&] { return grow(binding).has_value(); }));
}

TEST(ServerSetUp, RefusesTooManyLargeMessages) {
  ServerConfig config = quiet_config();
  config.large_message_count_max = 1025;
  const auto server = Server::create(config);
  ASSERT_FALSE(server);
  expect_text(server.error().text(), {"large_message_count_max is 1025", "Remedy", "0 to 1024"});
}

// Holds whether a lane buffers requests or not, and whatever used up a call's time.
TEST(LateCalls, AreCountedInEveryLane) {
  for (const std::uint32_t buffered_request_max : {0U, 8U}) {
    LaneConfig lane = quiet_lane();
    lane.buffered_request_max = buffered_request_max;
    auto server = std::move(*Server::create(quiet_config({lane})));
    DeferringServant late;
    echo::Servant servant;
    ASSERT_TRUE(server->add("echo", servant, {}));
    ASSERT_TRUE(server->add("late", late, {}));
    ASSERT_TRUE(server->start());
    Node node(quiet_node());
    auto deferred = Binding::bind(node, server->url("late"), echo::kInterface, {});
    auto binding = Binding::bind(node, server->url("echo"), echo::kInterface, {});
    ASSERT_TRUE(deferred && binding);
    EXPECT_FALSE(deferred->call(echo::kEchoOnce, {}, {.deadline = 100ms}));
    DeferredReply reply = late.reply();
    EXPECT_TRUE(await([&] { return rt::now() >= reply.deadline(); }));
    reply.complete(wire::Status::kOk);
    EXPECT_TRUE(await([&] { return server->counters().late_count == 1; })) << "deferred";
    {
      // Two channels with sessions, so that a call's time runs out in the lane.
      const auto first = binding->call(echo::kEcho, {});
      const auto second = binding->call(echo::kEcho, {});
      ASSERT_TRUE(first && second);
    }
    EXPECT_FALSE(binding->call(echo::kHold, {}, {.deadline = 100ms}));
    servant.gate().let_one_go();
    EXPECT_TRUE(await([&] { return server->counters().late_count == 2; })) << "it ran too long";
    std::thread holder([&] { EXPECT_TRUE(binding->call(echo::kHold, {})); });
    ASSERT_TRUE(await([&] { return servant.gate().inside_count() == 1; }));
    // The deadline is long enough to send the call, even on a busy machine.
    EXPECT_FALSE(binding->call(echo::kEchoOnce, {}, {.deadline = 100ms}));
    servant.gate().let_one_go();
    holder.join();
    EXPECT_TRUE(await([&] { return server->counters().late_count == 3; })) << "it waited too long";
    EXPECT_EQ(servant.run_count(), 4);
    server->stop();
  }
}

}  // namespace
}  // namespace rtpm::rpc
