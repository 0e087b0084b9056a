#include <gtest/gtest.h>

#include <set>

#include "peers.hpp"

// The server's half of the handshake: spec/hprotocol.md#hp-4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

// hp-4.1-6: a client that never receives a WELCOME must not fill the table by itself.
TEST(ServerHandshake, TakesOneSlotPerChannel) {
  ServerSessions server(server_config());
  Peer peer;
  for (std::uint32_t i = 1; i < 20; ++i) {
    peer.handshake_number = i;
    EXPECT_EQ(peer.open(server, at(0s)).kind, FrameKind::kWelcome);
  }
  EXPECT_EQ(server.session_count(), 1u);
  EXPECT_EQ(server.counters().session_evicted_count, 0u);
}

/// A separate host for each number.
PeerAddress host(std::uint64_t number) {
  return {.high = 0, .low = 0x0a00'0000 + number, .port = 4711};
}

/// Opens `count` peers' sessions one second apart, each on its own host; `server` accepts no more.
std::vector<Peer> fill(ServerSessions& server, std::uint32_t count) {
  std::vector<Peer> peers(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    peers[i].channel = i + 1;
    peers[i].address = host(i + 1);
    peers[i].open(server, at(std::chrono::seconds{i}));
    EXPECT_NE(peers[i].session, 0u);
  }
  return peers;
}

TEST(ServerSessionTable, ReplacesTheLongestSilentSession) {
  ServerSessions server(server_config());
  const std::vector<Peer> peers = fill(server, 4);
  Peer newcomer;
  newcomer.channel = 99;
  EXPECT_EQ(newcomer.open(server, at(kSessionIdleMin)).kind, FrameKind::kWelcome);
  EXPECT_EQ(server.counters().session_evicted_count, 1u);
  EXPECT_EQ(server.session_count(), 4u);
  const auto status_of_call = [&](const Peer& peer) {
    const Verdict verdict = server.on_frame(peer.call_frame(1), peer.address, at(kSessionIdleMin));
    return verdict.action == Action::kDispatch ? Status::kOk : header_of(verdict.frame).status;
  };
  EXPECT_EQ(status_of_call(peers[0]), Status::kUnknownSession) << "it was the first to fall silent";
  EXPECT_EQ(status_of_call(peers[1]), Status::kOk);
  EXPECT_EQ(status_of_call(newcomer), Status::kOk);
}

/// Peers on one host, until the server accepts no more of them.
std::vector<Peer> fill_from_one_host(ServerSessions& server, PeerAddress address) {
  std::vector<Peer> peers;
  for (std::uint32_t i = 0; i < 100; ++i) {
    Peer peer;
    peer.channel = i + 1;
    peer.address = address;
    peer.address.port = 5000 + i;
    if (peer.open(server, at(0s)).kind != FrameKind::kWelcome) break;
    peers.push_back(peer);
  }
  return peers;
}

// hp-4-7
TEST(ServerSessionTable, GivesOneHostThreeQuartersOfItsSlots) {
  for (const auto& [count_max, of_one_host] :
       {std::pair{1u, 1u}, {2u, 2u}, {3u, 3u}, {4u, 3u}, {5u, 4u}, {8u, 6u}, {16u, 12u}}) {
    ServerSessionsConfig config = server_config();
    config.session_count_max = count_max;
    ServerSessions server(config);
    EXPECT_EQ(fill_from_one_host(server, host(1)).size(), of_one_host) << count_max;
    EXPECT_EQ(fill_from_one_host(server, host(2)).size(), count_max - of_one_host) << count_max;
    EXPECT_EQ(server.session_count(), count_max);
  }
}

// hp-4-7
TEST(ServerSessionTable, LetsAHostAtItsShareReplaceOnlyItsOwnSessions) {
  ServerSessions server(server_config());
  Peer oldest_of_all;
  oldest_of_all.address = host(2);
  oldest_of_all.open(server, at(-1s));
  const std::vector<Peer> peers = fill_from_one_host(server, host(1));
  ASSERT_EQ(peers.size(), 3u);
  static_cast<void>(server.on_frame(peers[0].call_frame(1), peers[0].address, at(kSessionIdleMin)));
  Peer next = peers.back();
  next.channel = 99;
  EXPECT_EQ(next.open(server, at(kSessionIdleMin)).kind, FrameKind::kWelcome);
  const auto is_known = [&](const Peer& peer) {
    const Bytes frame = peer.call_frame(2);
    return server.on_frame(frame, peer.address, at(kSessionIdleMin)).action == Action::kDispatch;
  };
  EXPECT_TRUE(is_known(oldest_of_all)) << "it is another host's, though silent longest";
  EXPECT_TRUE(is_known(peers[0])) << "it was heard";
  EXPECT_EQ(is_known(peers[1]) + is_known(peers[2]), 1) << "one of these was replaced";
}

// hp-4-7: a connection's address does not identify a host; the acceptor counts hosts.
TEST(ServerSessionTable, GivesConnectionsAllSlots) {
  ServerSessions server(server_config(Medium::kStream));
  for (std::uint32_t i = 0; i < 4; ++i) {
    Peer peer;
    peer.address.port = i;
    EXPECT_EQ(peer.open(server, at(0s), Medium::kStream).kind, FrameKind::kWelcome);
  }
}

TEST(ServerSessionTable, RunsTheFirstCallOfASessionInAReusedSlot) {
  ServerSessionsConfig config = server_config();
  config.session_count_max = 1;
  ServerSessions server(config);
  Peer former;
  former.open(server, at(0s));
  const Verdict verdict = server.on_frame(former.call_frame(1), former.address, at(0s));
  static_cast<void>(answer(server, verdict.request, "former", at(0s)));
  Peer next;
  next.channel = 2;
  next.open(server, at(kSessionIdleMin));
  const Verdict first = server.on_frame(next.call_frame(1), next.address, at(kSessionIdleMin));
  EXPECT_EQ(first.action, Action::kDispatch) << "not answered from the former session's cache";
}

TEST(ServerSessionTable, DropsTheSessionOfAClosedConnection) {
  ServerSessions server(server_config(Medium::kStream));
  Peer one;
  Peer other;
  other.address.high = 2;
  one.open(server, at(0s), Medium::kStream);
  other.open(server, at(0s), Medium::kStream);
  server.end_connection(one.address);
  EXPECT_EQ(server.session_count(), 1u);
  const Verdict verdict = server.on_frame(one.call_frame(1), one.address, at(0s));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
  EXPECT_EQ(server.on_frame(other.call_frame(1), other.address, at(0s)).action, Action::kDispatch);
}

TEST(ServerSessionTable, NeverReusesASessionNumber) {
  ServerSessions server(server_config());
  std::set<std::uint64_t> numbers;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    Peer peer;
    peer.handshake_number = i;
    peer.open(server, at(i * kSessionIdleMin));
    numbers.insert(peer.session);
  }
  EXPECT_EQ(numbers.size(), 1000u);
  EXPECT_FALSE(numbers.contains(0));
}

TEST(ServerSessionTable, GivesOtherNumbersUnderAnotherKey) {
  ServerSessionsConfig config = server_config();
  ServerSessions one(config);
  config.key.high = 3;
  ServerSessions other(config);
  Peer peer;
  peer.open(one, at(0s));
  const std::uint64_t first = peer.session;
  peer.open(other, at(0s));
  EXPECT_NE(peer.session >> 16, first >> 16) << "numbers must not be guessed from one another";
}

// hp-4.4-1: almost no random number is mistaken for another lane's session.
TEST(ServerSessionTable, RefusesRandomSessionNumbers) {
  ServerSessionsConfig config = server_config();
  config.lane = 1;
  config.lane_count = 64;
  config.band = {1000, Priority::kHighest};
  Random random(1);
  ServerSessions lane(config);
  Peer peer;
  for (int i = 0; i < 20'000; ++i) {
    peer.session = random();
    const Verdict verdict = lane.on_frame(peer.call_frame(1), peer.address, at(i * 2ms));
    ASSERT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
  }
}

/// A frame that any stranger may send: of any kind, with or without faults.
Bytes any_frame(Random& random, const Peer& peer) {
  switch (random() % 4) {
    case 0:
      return random_bytes(random, random() % 200);
    case 1: {
      Hello hello = peer.hello();
      hello.version_min = static_cast<std::uint16_t>(random() % 3);
      hello.message_size_max >>= random() % 32;
      if (random() % 2 == 0) hello.cookie[random() % 16] = std::byte{1};
      return peer.hello_frame(hello);
    }
    default: {
      const Header header = random_header(random);
      return frame_of(header, random_bytes(random, random() % 100));
    }
  }
}

// hp-4.2-1, hp-4.4-2: a forged address gets no more bytes than the forger sends.
TEST(ServerFrames, FromAnUnprovenAddressGetNoMoreBytesThanTheySent) {
  Random random(1);
  ServerSessionsConfig config = server_config();
  config.band = {10'000, 20'000};
  ServerSessions server(config);
  std::uint64_t answered_count = 0;
  for (int round = 0; round < 20'000; ++round) {
    Peer peer;
    peer.priority = static_cast<int>(random() % (Priority::kHighest + 1));
    const Bytes frame = any_frame(random, peer);
    const Verdict verdict = server.on_frame(frame, peer.address, at(round * 2ms));
    ASSERT_LE(verdict.frame.size(), frame.size());
    ASSERT_NE(verdict.action, Action::kDispatch);
    answered_count += verdict.action == Action::kSend ? 1 : 0;
  }
  EXPECT_EQ(server.session_count(), 0u);
  EXPECT_EQ(server.counters().received_count, 20'000u);
  EXPECT_GT(answered_count, 1000u);
}

}  // namespace
}  // namespace rtpm::wire
