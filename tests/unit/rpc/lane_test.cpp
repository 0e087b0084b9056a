#include "lane/lane.hpp"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "noting_servant.hpp"
#include "one_port.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/serve.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// Keeps the server's lane busy until the test releases it.
class BusyLane {
 public:
  explicit BusyLane(EchoServer& server)
      : server_(server), peer_(Transport::kUdp, server.server->port()) {
    EXPECT_TRUE(peer_.open());
    peer_.send(peer_.call_frame(1, echo::kHold.id));
    EXPECT_TRUE(await([&] { return server_.servant.gate().inside_count() == 1; }));
  }
  void end() { server_.servant.gate().let_one_go(); }

 private:
  EchoServer& server_;
  RawPeer peer_;
};

Bytes together(const std::vector<Bytes>& frames) {
  Bytes all;
  for (const Bytes& frame : frames)
    all.insert(all.end(), frame.begin(), frame.end());
  return all;
}

// Frames in a connection's buffer do not wake a poll: a lane that turned to another connection must
// come back to the first one before it sleeps.
TEST(Lane, ServesFramesReceivedTogetherOnSeveralConnections) {
  EchoServer server;
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < 3; ++i) {
    peers.push_back(std::make_unique<RawPeer>(Transport::kTcp, server.server->port()));
    ASSERT_TRUE(peers.back()->open());
  }
  BusyLane busy(server);
  for (const auto& peer : peers) {
    peer->send(together({peer->call_frame(1, echo::kEcho.id, "first"),
                         peer->call_frame(2, echo::kEcho.id, "second"),
                         peer->call_frame(3, echo::kEcho.id, "third")}));
  }
  busy.end();
  for (const auto& peer : peers) {
    for (const std::uint32_t call_id : {1u, 2u, 3u}) {
      const auto answer = peer->receive_answer(call_id);
      ASSERT_TRUE(answer) << "call " << call_id;
      EXPECT_EQ(answer->status, wire::Status::kOk);
    }
  }
}

// A lane has different ways to wait for its port alone, for few connections and for many.
TEST(Lane, ServesAnyNumberOfCallersWhileItGrowsAndShrinks) {
  EchoServer server;
  RawPeer datagrams(Transport::kUdp, server.server->port());
  ASSERT_TRUE(datagrams.open());
  std::vector<std::unique_ptr<RawPeer>> streams;
  std::uint32_t call_id = 0;
  const auto expect_all_served = [&] {
    ++call_id;
    const auto call = [&](RawPeer& peer) {
      peer.send(peer.call_frame(call_id, echo::kEcho.id, "hello"));
      EXPECT_TRUE(peer.receive_answer(call_id)) << streams.size() << " streams";
    };
    call(datagrams);
    for (const auto& stream : streams)
      call(*stream);
  };
  for (const std::size_t count : {1u, 4u, 5u, 9u, 5u, 3u, 2u, 0u, 6u, 0u}) {
    streams.clear();
    ASSERT_TRUE(await([&] {
      return server.server->counters().connection_lost_count ==
             server.server->counters().connection_count;
    }));
    while (streams.size() < count) {
      streams.push_back(std::make_unique<RawPeer>(Transport::kTcp, server.server->port()));
      ASSERT_TRUE(streams.back()->open());
    }
    expect_all_served();
    // The number of connections shrinks again, one by one.
    for (; !streams.empty(); streams.pop_back())
      expect_all_served();
  }
}

// The lane checks some of the callers at a time.
TEST(Lane, ServesEveryCallerThroughMemoryBesideSilentOnes) {
  for (const rt::WaitStrategy wait :
       {rt::WaitStrategy::kSpin, rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kBlock}) {
    LaneConfig lane = quiet_lane();
    lane.wait.strategy = wait;
    EchoServer server(quiet_config({lane}));
    std::vector<std::unique_ptr<RawPeer>> peers;
    for (int i = 0; i < 40; ++i) {
      peers.push_back(std::make_unique<RawPeer>(Transport::kSharedMemory, server.server->port()));
      ASSERT_TRUE(peers.back()->open());
    }
    std::uint32_t call_id = 0;
    const auto expect_answer = [&](RawPeer& peer) {
      EXPECT_TRUE(peer.receive_answer(call_id)) << peers.size() << ", " << to_string(wait);
    };
    const auto call = [&](RawPeer& peer) {
      peer.send(peer.call_frame(call_id, echo::kEcho.id, "hello"));
    };
    // Callers call one by one and all at once; after some have disconnected, so do the others.
    for (int i = 0; i < 3; ++i) {
      ++call_id;
      for (const auto& peer : peers) {
        call(*peer);
        expect_answer(*peer);
      }
      ++call_id;
      for (const auto& peer : peers)
        call(*peer);
      for (const auto& peer : peers)
        expect_answer(*peer);
      std::erase_if(peers, [&](const auto& peer) { return (&peer - peers.data()) % 3 == 0; });
    }
  }
}

// A batch of datagrams is a source like any other.
TEST(Lane, ServesOthersWhileABatchOfDatagramsTakesLong) {
  constexpr std::uint32_t kBatch = 40;
  NotingServant servant;
  const auto server = rtpm::test::serve("echo", servant, quiet_config());
  RawPeer many(Transport::kUdp, server->port(), Priority{1});
  RawPeer other(Transport::kTcp, server->port(), Priority{2});
  ASSERT_TRUE(many.open() && other.open());
  const auto hold = [&](std::uint32_t call_id) {
    many.send(many.call_frame(call_id, echo::kHold.id));
    ASSERT_TRUE(await([&] { return servant.gate.inside_count() == 1; }));
  };
  // Datagrams without a pause make the port receive batches.
  hold(1);
  const Bytes garbage(wire::kHeaderSize, std::byte{0x55});
  for (int i = 0; i < 100; ++i)
    many.send(garbage);
  servant.gate.let_one_go();
  ASSERT_TRUE(await([&] { return server->counters().frames.received_count > 100; }));
  hold(2);
  servant.pace = 300us;
  Bytes batch;
  for (std::uint32_t i = 0; i < kBatch; ++i) {
    const Bytes frame = many.call_frame(3 + i, echo::kEcho.id);
    batch.insert(batch.end(), frame.begin(), frame.end());
  }
  const int frame_size = wire::kHeaderSize;
  ASSERT_EQ(setsockopt(many.descriptor(), SOL_UDP, UDP_SEGMENT, &frame_size, sizeof frame_size), 0);
  ASSERT_EQ(::send(many.descriptor(), batch.data(), batch.size(), 0), std::ssize(batch));
  other.send(other.call_frame(1, echo::kEcho.id));
  servant.gate.let_one_go();
  ASSERT_TRUE(other.receive_answer(1));
  ASSERT_TRUE(await([&] { return servant.order().size() == kBatch + 1; }));
  const std::vector<int> order = servant.order();
  EXPECT_LT(std::ranges::find(order, 2) - order.begin(), 16);
  server->stop();
}

// An overloaded server is the one that people investigate.
TEST(Lane, PublishesItsCountersWhileAlwaysBusy) {
  EchoServer server;
  RawPeer peer(Transport::kUdp, server.server->port());
  ASSERT_TRUE(peer.open());
  echo::Gate& gate = server.servant.gate();
  peer.send(peer.call_frame(1, echo::kHold.id));
  for (std::uint32_t call_id = 1; call_id <= 5; ++call_id) {
    ASSERT_TRUE(await([&] { return gate.inside_count() == 1; }));
    EXPECT_TRUE(await([&] { return server.server->counters().call_count >= call_id - 1; }));
    peer.send(peer.call_frame(call_id + 1, echo::kHold.id));
    gate.let_one_go();
    ASSERT_TRUE(peer.receive_answer(call_id));
  }
}

/// A lane by itself, without an acceptor that takes connections back.
class LaneAlone {
 public:
  explicit LaneAlone(std::uint32_t session_count_max, rt::WaitStrategy wait) {
    config_.lanes.resize(1);
    config_.lanes.front().wait.strategy = wait;
    config_.session_count_max = session_count_max;
    config_.message_size_max = 1024;
    LaneSetup setup;
    setup.server = &config_;
    setup.epoch = 1;
    setup.objects = &objects_;
    setup.acceptor_bell = acceptor_bell_.get();
    setup.slot = &slot_;
    const auto listener = transport::TcpListener::open("127.0.0.1", 0);
    lane_ = std::make_unique<Lane>(
        setup, test::one_port(listener->port()),
        std::move(*transport::WaitSet::open_for_lane(wait_source_count(session_count_max))));
    EXPECT_TRUE(lane_->start(rt::RealtimeMode::kOff, nullptr));
  }
  ~LaneAlone() {
    lane_->stop();
    lane_->join();
  }
  LaneAlone(const LaneAlone&) = delete;
  LaneAlone& operator=(const LaneAlone&) = delete;

  /// Gives the lane a connection; returns its far end.
  transport::Descriptor connect() {
    std::array<int, 2> ends{};
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends.data()), 0);
    std::unique_ptr<transport::Connection> stream =
        std::make_unique<transport::FrameStream>(transport::Descriptor(ends[0]), 1024);
    EXPECT_TRUE(await([&] { return lane_->adopt(stream); })) << "the lane adopts no connection";
    return transport::Descriptor(ends[1]);
  }
  Lane& lane() { return *lane_; }

 private:
  ServerConfig config_;
  ObjectTable objects_;
  std::unique_ptr<transport::WaitSet> acceptor_bell_ = std::move(*transport::WaitSet::open(1));
  LaneSlot slot_;
  std::unique_ptr<Lane> lane_;
};

bool is_hung_up(const transport::Descriptor& far_end) {
  std::byte byte{};
  return recv(far_end.number(), &byte, 1, MSG_DONTWAIT) == 0;
}

// The lane gets more connections than it has slots, and no acceptor takes them back.
TEST(Lane, ClosesAnyNumberOfSurplusConnections) {
  constexpr int kConnectionCount = 400;
  LaneAlone alone(/*session_count_max=*/1, rt::WaitStrategy::kBlock);
  std::vector<transport::Descriptor> far_ends;
  for (int i = 0; i < kConnectionCount; ++i)
    far_ends.push_back(alone.connect());
  EXPECT_TRUE(await([&] {
    while (alone.lane().take_back() != nullptr) {
    }
    return std::ranges::count_if(far_ends, is_hung_up) == kConnectionCount - 1;
  }));
}

// The doorbell may ring at any moment of a lane's iteration, even the last before it sleeps.
TEST(Lane, HandlesEachRingOfItsDoorbell) {
  std::mt19937_64 random(1);
  std::optional<LaneAlone> lane;
  transport::Descriptor served;
  for (int round = 0; round < 5000; ++round) {
    // A connection without a session loses its slot after 2 s, which a busy machine takes.
    if (round % 250 == 0) {
      lane.emplace(/*session_count_max=*/1, rt::WaitStrategy::kBlock);
      served = lane->connect();
    }
    LaneAlone& alone = *lane;
    // Two surplus connections; the second rings while the lane is about to sleep again.
    const transport::Descriptor first = alone.connect();
    const MonotonicTime moment = rt::now() + Duration{static_cast<int>(random() % 60'000)};
    while (rt::now() < moment) {
    }
    const transport::Descriptor second = alone.connect();
    const auto are_ended = [&] {
      while (alone.lane().take_back() != nullptr) {
      }
      return is_hung_up(first) && is_hung_up(second);
    };
    // Polls without sleeping in the usual case, for more rounds.
    const MonotonicTime soon = rt::now() + 5ms;
    while (!are_ended() && rt::now() < soon) {
    }
    ASSERT_TRUE(await(are_ended)) << "round " << round;
  }
}

TEST(Lane, ServesEverySourceBesideItsOnlyConnection) {
  for (const rt::WaitStrategy wait : {rt::WaitStrategy::kBlock, rt::WaitStrategy::kAdaptive}) {
    LaneConfig lane;
    lane.wait = {.strategy = wait, .spin = std::chrono::microseconds{1}};
    EchoServer server(quiet_config({lane}));
    RawPeer only(Transport::kTcp, server.server->port());
    ASSERT_TRUE(only.open());
    std::uint32_t call_id = 0;
    constexpr int kCallCount = 16;
    const auto call_often = [&] {
      for (int i = 0; i < kCallCount; ++i) {
        only.send(only.call_frame(++call_id, echo::kEcho.id));
        ASSERT_TRUE(only.receive_answer(call_id)) << call_id;
      }
    };
    call_often();
    RawPeer by_datagrams(Transport::kUdp, server.server->port());
    ASSERT_TRUE(by_datagrams.open());
    call_often();
    by_datagrams.send(by_datagrams.call_frame(1, echo::kEcho.id));
    ASSERT_TRUE(by_datagrams.receive_answer(1));
    call_often();
    {
      RawPeer second(Transport::kTcp, server.server->port());
      ASSERT_TRUE(second.open());
      second.send(second.call_frame(1, echo::kEcho.id));
      ASSERT_TRUE(second.receive_answer(1));
    }
    call_often();
    Node node(quiet_node(Transport::kLocal));
    auto local = Binding::bind(node, server.server->url("echo"), echo::kInterface);
    ASSERT_TRUE(local) << local.error().text();
    ASSERT_TRUE(local->call(echo::kEcho, {}));
    call_often();
    ASSERT_TRUE(local->call(echo::kEcho, {}));
    call_often();
    // The server stops at once, with all its connections.
    server.server->stop();
  }
}

TEST(Lane, AdoptsEveryConnection) {
  LaneAlone alone(/*session_count_max=*/8, rt::WaitStrategy::kSpin);
  const Bytes garbage(wire::kHeaderSize, std::byte{0x55});
  for (int round = 0; round < 200; ++round) {
    // Two connections come in quick succession: one arrives while the lane takes over the other.
    std::array far_ends{alone.connect(), alone.connect()};
    for (const transport::Descriptor& far_end : far_ends) {
      ASSERT_EQ(send(far_end.number(), garbage.data(), garbage.size(), MSG_NOSIGNAL),
                static_cast<ssize_t>(garbage.size()));
    }
    // Only a lane that took a connection over ends it because of garbage.
    ASSERT_TRUE(await([&] {
      while (alone.lane().take_back() != nullptr) {
      }
      return std::ranges::all_of(far_ends, is_hung_up);
    })) << "round "
        << round;
  }
}

}  // namespace
}  // namespace rtpm::rpc
