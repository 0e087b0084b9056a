#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/test/echo_server.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"

// Calls to servers that misbehave, or that come and go.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// A handmade server for one TCP connection: it shakes hands, answers a bind, and then treats each
/// call as the test says.
class FakeServer {
 public:
  using OnCall = std::function<void(transport::FrameStream& stream, const wire::Header& call)>;

  explicit FakeServer(OnCall on_call)
      : listener_(std::move(*transport::TcpListener::open("127.0.0.1", 0))),
        thread_([this, on_call = std::move(on_call)] { serve(on_call); }) {}
  ~FakeServer() {
    is_stopping_ = true;
    thread_.join();
  }
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;
  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(listener_.port()) + "/echo";
  }
  [[nodiscard]] const std::atomic<bool>& is_stopping() const { return is_stopping_; }

  static bool send(transport::FrameStream& stream, wire::Header header, ConstBytes payload = {}) {
    header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
    Bytes frame(wire::kHeaderSize);
    wire::encode(header, frame.data());
    frame.insert(frame.end(), payload.begin(), payload.end());
    return stream.send(frame, rt::now() + 10ms).has_value();
  }

 private:
  void serve(const OnCall& on_call) {
    while (!is_stopping_) {
      if (!transport::wait_readable(listener_.descriptor(), rt::now() + 10ms)) continue;
      if (auto connection = listener_.accept().socket; connection.is_open()) {
        serve(std::move(connection), on_call);
      }
    }
  }
  void serve(transport::Descriptor connection, const OnCall& on_call) {
    transport::FrameStream stream(std::move(connection), 64 * 1024);
    while (!is_stopping_) {
      const auto frame = stream.receive();
      if (!frame) {
        if (frame.error() == transport::IoError::kClosed) return;
        static_cast<void>(transport::wait_readable(stream.descriptor(), rt::now() + 10ms));
        continue;
      }
      wire::Header header = *wire::decode_frame(*frame);
      if (header.kind == wire::FrameKind::kHello) {
        header.kind = wire::FrameKind::kWelcome;
        header.session = 1;
        wire::Welcome welcome;
        welcome.server_epoch = 1;
        welcome.message_size_max = 64 * 1024;
        welcome.ceiling = Priority::kHighest;
        Bytes payload(wire::Welcome::kSize);
        encode(welcome, payload);
        send(stream, header, payload);
      } else if (header.kind == wire::FrameKind::kCall && header.service == 0) {
        header.kind = wire::FrameKind::kReply;
        wire::BindReply reply;
        reply.service = 1;
        reply.fingerprint = echo::kInterface.fingerprint;
        Bytes payload(wire::BindReply::kSize);
        encode(reply, payload);
        send(stream, header, payload);
      } else if (header.kind == wire::FrameKind::kCall) {
        on_call(stream, header);
      }
    }
  }

  transport::TcpListener listener_;
  std::atomic<bool> is_stopping_{false};
  std::thread thread_;
};

Binding bind_to(Node& node, const FakeServer& server) {
  auto bound =
      Binding::bind(node, server.url(), echo::kInterface, {.deadline = rtpm::test::kPatience});
  EXPECT_TRUE(bound) << bound.error().text();
  return std::move(*bound);
}

// Whatever arrives, a call ends at its deadline.
TEST(Call, EndsAtItsDeadlineThroughAFloodOfForeignFrames) {
  std::optional<FakeServer> server;
  server.emplace([&server](transport::FrameStream& stream, wire::Header header) {
    header.kind = wire::FrameKind::kReply;
    header.call_id += 1000;
    Bytes flood;
    for (int i = 0; i < 1000; ++i) {
      flood.resize(flood.size() + wire::kHeaderSize);
      header.payload_size = header.message_size = 0;
      wire::encode(header, flood.data() + flood.size() - wire::kHeaderSize);
    }
    while (!server->is_stopping() && stream.send(flood, rt::now() + 10s)) {
    }
  });
  Node node(quiet_node(Transport::kTcp));
  Binding binding = bind_to(node, *server);
  const MonotonicTime begin = rt::now();
  const auto reply = binding.call(echo::kEcho, {}, {.deadline = 50ms});
  EXPECT_GE(rt::now() - begin, Duration{50ms});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kTimeout);
}

// A reply in one segment with another frame does not wake a poll again.
TEST(Call, FindsItsReplyBehindAForeignFrame) {
  FakeServer server([](transport::FrameStream& stream, wire::Header header) {
    header.kind = wire::FrameKind::kReply;
    header.payload_size = header.message_size = 0;
    Bytes both(2 * wire::kHeaderSize);
    wire::encode(header, both.data() + wire::kHeaderSize);
    --header.call_id;
    wire::encode(header, both.data());
    EXPECT_TRUE(stream.send(both, rt::now() + 10s));
  });
  Node node(quiet_node(Transport::kTcp));
  Binding binding = bind_to(node, server);
  const MonotonicTime deadline = rt::now() + rtpm::test::kPatience;
  EXPECT_TRUE(binding.call(echo::kEchoOnce, {}, {.deadline = rtpm::test::kPatience}));
  EXPECT_LT(rt::now(), deadline) << "it was found only when there was nothing left to wait for";
}

TEST(Call, IsBrokenByGarbageOnItsConnection) {
  FakeServer server([](transport::FrameStream& stream, const wire::Header&) {
    EXPECT_TRUE(stream.send(Bytes(200, std::byte{0x55}), rt::now() + 10s));
  });
  Node node(quiet_node(Transport::kTcp));
  Binding binding = bind_to(node, server);
  const auto reply = binding.call(echo::kEchoOnce, {});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kDisconnected);
}

/// The error of a call that the server answers with `status`.
std::optional<CallError> error_for(wire::Status status) {
  FakeServer server([status](transport::FrameStream& stream, wire::Header header) {
    header.kind = wire::FrameKind::kReply;
    header.status = status;
    FakeServer::send(stream, header);
  });
  Node node(quiet_node(Transport::kTcp));
  Binding binding = bind_to(node, server);
  const auto reply = binding.call(echo::kEchoOnce, {});
  if (reply) return std::nullopt;
  return reply.error();
}

TEST(Call, MapsTheStatusToAnError) {
  using wire::Status;
  EXPECT_EQ(error_for(Status::kOk), std::nullopt);
  EXPECT_EQ(error_for(Status::kOverload), CallError::kOverload);
  EXPECT_EQ(error_for(Status::kExpired), CallError::kExpired);
  EXPECT_EQ(error_for(Status::kNoSuchMethod), CallError::kNoSuchMethod);
  EXPECT_EQ(error_for(Status::kNoSuchObject), CallError::kNoSuchObject);
  EXPECT_EQ(error_for(Status::kGone), CallError::kNoSuchObject);
  EXPECT_EQ(error_for(Status::kBadRequest), CallError::kBadRequest);
  EXPECT_EQ(error_for(Status::kNotLeaseHolder), CallError::kNotLeaseHolder);
  EXPECT_EQ(error_for(Status::kServantFailed), CallError::kServantFailed);
  EXPECT_EQ(error_for(Status::kTooLarge), CallError::kTooLarge);
  EXPECT_EQ(error_for(Status::kPriorityNotAllowed), CallError::kPriorityNotAllowed);
  EXPECT_EQ(error_for(Status::kNotAllowed), CallError::kNotAllowed);
  EXPECT_EQ(error_for(Status::kWrongBand), CallError::kWrongBand);
  EXPECT_EQ(error_for(Status::kWrongInterface), CallError::kWrongInterface);
  EXPECT_EQ(error_for(Status::kUnknownSession), CallError::kRefused);
}

// A status of a later version: the client cannot promise that the servant did not run.
TEST(Call, MapsAnUnknownStatusToABadReply) {
  // hp-5.1-7
  EXPECT_EQ(error_for(static_cast<wire::Status>(wire::kStatusCount)), CallError::kBadReply);
  EXPECT_EQ(error_for(static_cast<wire::Status>(0xffff)), CallError::kBadReply);
}

// hp-4.5-2: an open call may have run, even if the server goes on without a restart.
TEST(Call, IsNotRepeatedAfterTheServerClosedItsSession) {
  std::atomic<int> count{0};
  FakeServer server([&](transport::FrameStream& stream, const wire::Header& call) {
    ++count;
    wire::Header close;
    close.kind = wire::FrameKind::kClose;
    close.session = call.session;
    FakeServer::send(stream, close);
  });
  Node node(quiet_node(Transport::kTcp));
  Binding binding = bind_to(node, server);
  const auto reply = binding.call(echo::kEchoOnce, {}, {.deadline = 2s});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kStopped);
  EXPECT_EQ(count, 1);
}

TEST(Call, AcceptsAnUnlimitedDeadline) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, {}, {.deadline = Duration::max()}));
  EXPECT_TRUE(binding.call(echo::kEcho, {}, {.deadline = std::chrono::hours{24 * 365 * 290}}));
}

TEST(Call, IsNotRunWithoutAnyTime) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  for (const Duration none : {Duration{0}, Duration{-1}, Duration::min()}) {
    const auto reply = binding.call(echo::kEchoOnce, {}, {.deadline = none});
    ASSERT_FALSE(reply);
    // Either the caller or the server notices it first.
    EXPECT_TRUE(is_late(reply.error())) << to_string(reply.error());
  }
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  EXPECT_EQ(server.servant.run_count(), 1);
}

// Callers of one band that use up their channels do not affect those of other bands.
TEST(Channels, AreCountedPerBand) {
  EchoServer server(quiet_config({quiet_lane(0), quiet_lane(20'000)}));
  NodeConfig config = quiet_node();
  config.channel_count_max = 1;
  Node node(config);
  Binding binding = bind_echo(node, server, {.warm_up = {0}});
  std::thread low([&] {
    const auto reply = binding.call(echo::kHold, bytes_of("low"), {.priority = 0});
    EXPECT_TRUE(reply);
  });
  ASSERT_TRUE(await([&] { return server.servant.gate().inside_count() == 1; }));
  const auto second = binding.call(echo::kEcho, {}, {.priority = 100});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error(), CallError::kNoChannel);
  const auto urgent = binding.call(echo::kEcho, bytes_of("urgent"), {.priority = 20'000});
  ASSERT_TRUE(urgent) << to_string(urgent.error());
  EXPECT_EQ(text_of(*urgent), "urgent");
  server.servant.gate().let_one_go();
  low.join();
}

// bind()'s deadline includes opening all channels.
TEST(BindDeadline, IncludesTheWarmUp) {
  EchoServer server(quiet_config({quiet_lane(0), quiet_lane(20'000)}));
  RawPeer peer(Transport::kUdp, server.server->port(), 20'000);
  ASSERT_TRUE(peer.open());
  peer.send(peer.call_frame(1, echo::kHold.id));
  ASSERT_TRUE(await([&] { return server.servant.gate().inside_count() == 1; }));
  NodeConfig config = quiet_node();
  config.default_deadline = 1h;
  Node node(config);
  const auto bound = Binding::bind(node, server.url(), echo::kInterface,
                                   {.deadline = 50ms, .warm_up = {0, 20'000}});
  ASSERT_FALSE(bound) << "the lane of 20000 is busy";
  expect_text(bound.error().text(), {"'echo'", "no reply came within the deadline"});
}

}  // namespace
}  // namespace rtpm::rpc
