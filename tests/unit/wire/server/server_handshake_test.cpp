#include <gtest/gtest.h>

#include <set>

#include "peers.hpp"

// The server's half of the handshake: spec/hprotocol.md#hp-4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

/// Expects that the server refuses the HELLO with `status`.
void expect_refusal(const Verdict& verdict, const Peer& peer, Status status) {
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_EQ(verdict.frame.size(), kHeaderSize);
  const Header header = header_of(verdict.frame);
  EXPECT_EQ(header.kind, FrameKind::kRefuse);
  EXPECT_EQ(header.status, status);
  EXPECT_EQ(header.session, 0u);
  EXPECT_EQ(header.call_id, peer.handshake_number);
  EXPECT_EQ(header.priority, peer.priority);
}

// hp-4.2-1
TEST(ServerHandshake, AnswersAFirstHelloWithACookieAndKeepsNothing) {
  ServerSessions server(server_config());
  Peer peer;
  peer.handshake_number = 9;
  const Bytes hello = peer.hello_frame();
  const Verdict verdict = server.on_frame(hello, peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_LT(verdict.frame.size(), hello.size());
  const Header header = header_of(verdict.frame);
  EXPECT_EQ(header.kind, FrameKind::kCookie);
  EXPECT_EQ(header.call_id, 9u);
  EXPECT_EQ(header.priority, peer.priority);
  EXPECT_EQ(header.session, 0u);
  EXPECT_EQ(server.session_count(), 0u);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadCookie), 0u);
}

TEST(ServerHandshake, OpensASessionForAProvenAddress) {
  ServerSessionsConfig config = server_config();
  config.band = {50, 200};
  config.ceiling = 150;
  ServerSessions server(config);
  Peer peer;
  const Bytes hello = peer.proven_hello_frame(server, at(0s));
  const Verdict verdict = server.on_frame(hello, peer.address, at(1ms));
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_LE(verdict.frame.size(), hello.size());
  const Header header = header_of(verdict.frame);
  EXPECT_EQ(header.kind, FrameKind::kWelcome);
  EXPECT_EQ(header.call_id, peer.handshake_number);
  EXPECT_NE(header.session, 0u);
  const auto welcome = decode_welcome(payload_of(verdict.frame));
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->band, (Band{50, 200}));
  EXPECT_EQ(welcome->ceiling, Priority{150});
  EXPECT_EQ(welcome->window, kCallWindow);
  EXPECT_EQ(welcome->server_epoch, kServerEpoch);
  EXPECT_EQ(welcome->clock_domain, kServerClock);
  EXPECT_EQ(welcome->message_size_max, kDatagramPayloadSizeMax);
  EXPECT_EQ(server.session_count(), 1u);
  EXPECT_EQ(server.counters().session_opened_count, 1u);
}

TEST(ServerHandshake, OnAStreamNeedsNoCookie) {
  ServerSessionsConfig config = server_config(Medium::kStream);
  config.message_size_max = 5000;
  ServerSessions server(config);
  Peer peer;
  const Verdict verdict = server.on_frame(peer.hello_frame(), peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kWelcome);
  const auto welcome = decode_welcome(payload_of(verdict.frame));
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->message_size_max, 5000u);
  EXPECT_EQ(server.session_count(), 1u);
}

// hp-4.2-2
TEST(ServerHandshake, CountsACookieThatIsNotItsOwnAndGivesAnother) {
  ServerSessions server(server_config());
  Peer peer;
  Peer other;
  other.address.port = 4712;
  const Bytes stolen = peer.proven_hello_frame(server, at(0s));
  Verdict verdict = server.on_frame(stolen, other.address, at(0s));
  EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadCookie), 1u);

  verdict = server.on_frame(stolen, peer.address, at(2 * kCookieSpan));
  EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie) << "expired";
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadCookie), 2u);
  EXPECT_EQ(server.session_count(), 0u);
}

// hp-4.1-4
TEST(ServerHandshake, GivesACopyOfTheHelloTheSessionThatItOpened) {
  for (const Medium medium : {Medium::kDatagram, Medium::kStream}) {
    ServerSessions server(server_config(medium));
    Peer peer;
    const Bytes hello =
        medium == Medium::kDatagram ? peer.proven_hello_frame(server, at(0s)) : peer.hello_frame();
    const Header first = header_of(server.on_frame(hello, peer.address, at(0s)).frame);
    const Header second = header_of(server.on_frame(hello, peer.address, at(1s)).frame);
    EXPECT_EQ(first.kind, FrameKind::kWelcome);
    EXPECT_EQ(second.kind, FrameKind::kWelcome);
    EXPECT_EQ(second.session, first.session);
    EXPECT_EQ(server.session_count(), 1u);
    EXPECT_EQ(server.counters().session_opened_count, 1u);
  }
}

TEST(ServerHandshake, GivesEachChannelClientAndAddressItsOwnSession) {
  ServerSessionsConfig config = server_config();
  config.session_count_max = 16;
  ServerSessions server(config);
  Peer first;
  Peer second;
  second.channel = 2;
  Peer third;
  third.epoch = 78;
  Peer fourth;
  fourth.address.port = 4712;
  std::set<std::uint64_t> sessions;
  for (Peer* peer : {&first, &second, &third, &fourth}) {
    peer->open(server, at(0s));
    sessions.insert(peer->session);
  }
  EXPECT_EQ(sessions.size(), 4u);
  EXPECT_FALSE(sessions.contains(0));
}

// hp-4.1-6
TEST(ServerHandshake, ReplacesTheSessionOfItsChannel) {
  // After the largest number comes 0.
  for (const std::uint32_t number : {5u, 0x7fff'ffffu, 0xffff'ffffu}) {
    ServerSessions server(server_config());
    Peer peer;
    peer.handshake_number = number;
    peer.open(server, at(0s));
    const Peer former = peer;
    peer.handshake_number = number + 1;
    peer.open(server, at(0s));
    EXPECT_NE(peer.session, former.session);
    EXPECT_EQ(server.session_count(), 1u);
    const Verdict verdict = server.on_frame(former.call_frame(1), former.address, at(0s));
    EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
    EXPECT_EQ(server.on_frame(peer.call_frame(1), peer.address, at(0s)).action, Action::kDispatch);
  }
}

// hp-4.1-6: a late duplicate must not cost the client its session.
TEST(ServerHandshake, DropsALateHelloOfItsChannel) {
  ServerSessions server(server_config());
  Peer peer;
  peer.handshake_number = 1;
  const Bytes late = peer.proven_hello_frame(server, at(0s));
  peer.handshake_number = 2;
  peer.open(server, at(0s));
  EXPECT_EQ(server.on_frame(late, peer.address, at(1s)).action, Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kUnexpected), 1u);
  EXPECT_EQ(server.on_frame(peer.call_frame(1), peer.address, at(1s)).action, Action::kDispatch);
}

// hp-4.1-6: a client that never receives a WELCOME must not fill the table by itself.
TEST(ServerHandshake, OfOneChannelTakesOnePlaceHoweverOftenItIsTried) {
  ServerSessions server(server_config());
  Peer peer;
  for (std::uint32_t i = 1; i < 20; ++i) {
    peer.handshake_number = i;
    EXPECT_EQ(peer.open(server, at(0s)).kind, FrameKind::kWelcome);
  }
  EXPECT_EQ(server.session_count(), 1u);
  EXPECT_EQ(server.counters().session_evicted_count, 0u);
}

// hp-4-4
TEST(ServerHandshake, OnAStreamReplacesTheConnectionsSession) {
  ServerSessions server(server_config(Medium::kStream));
  Peer peer;
  peer.open(server, at(0s), Medium::kStream);
  const std::uint64_t former = peer.session;
  peer.handshake_number = 2;
  peer.open(server, at(1s), Medium::kStream);
  EXPECT_NE(peer.session, former);
  EXPECT_EQ(server.session_count(), 1u);
  EXPECT_EQ(server.on_frame(peer.call_frame(1), peer.address, at(1s)).action, Action::kDispatch);
  peer.session = former;
  const Verdict verdict = server.on_frame(peer.call_frame(2), peer.address, at(1s));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
}

// hp-4.1-2
TEST(ServerHandshake, RefusesVersionsThatItDoesNotSpeak) {
  struct Range {
    std::uint16_t min, max;
    bool is_spoken;
  };
  for (const Range range :
       {Range{1, 1, true}, Range{0, 1, true}, Range{1, 65535, true}, Range{0, 65535, true},
        Range{0, 0, false}, Range{2, 2, false}, Range{2, 65535, false}, Range{2, 1, false}}) {
    ServerSessions server(server_config());
    const Peer peer;
    Hello hello = peer.hello();
    hello.version_min = range.min;
    hello.version_max = range.max;
    const Verdict verdict = server.on_frame(peer.hello_frame(hello), peer.address, at(0s));
    if (range.is_spoken) {
      EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie);
      continue;
    }
    expect_refusal(verdict, peer, Status::kVersionUnsupported);
    EXPECT_EQ(server.counters().refused_count, 1u);
  }
}

// hp-4.1-2
TEST(ServerHandshake, RefusesAbsurdLimits) {
  ServerSessions server(server_config());
  Peer peer;
  for (const std::uint32_t good : {kMessageSizeFloor, kMessageSizeCeiling}) {
    peer.message_size_max = good;
    const Verdict verdict = server.on_frame(peer.hello_frame(), peer.address, at(0s));
    EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie) << good;
  }
  for (const std::uint32_t bad :
       {0u, kMessageSizeFloor - 1, kMessageSizeCeiling + 1, ~std::uint32_t{0}}) {
    peer.message_size_max = bad;
    expect_refusal(server.on_frame(peer.hello_frame(), peer.address, at(0s)), peer,
                   Status::kBadLimits);
  }
}

// hp-4.1-3
TEST(ServerHandshake, RefusesPrioritiesOutsideTheBand) {
  ServerSessionsConfig config = server_config();
  config.band = {100, 200};
  ServerSessions server(config);
  Peer peer;
  for (const int good : {100, 200}) {
    peer.priority = good;
    const Verdict verdict = server.on_frame(peer.hello_frame(), peer.address, at(0s));
    EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie) << good;
  }
  for (const int bad : {0, 99, 201, Priority::kHighest}) {
    peer.priority = bad;
    expect_refusal(server.on_frame(peer.hello_frame(), peer.address, at(0s)), peer,
                   Status::kWrongBand);
  }
}

// hp-4.1-5: each of these HELLOs has the expected fault, and all faults that come after it.
TEST(ServerHandshake, JudgesAHelloInOneOrder) {
  ServerSessionsConfig config = server_config();
  config.band = {100, 200};
  config.session_count_max = 1;
  ServerSessions server(config);
  Peer first;
  first.open(server, at(0s));
  Peer peer;
  peer.channel = 2;
  peer.priority = 99;
  Hello hello = peer.hello();
  hello.cookie.fill(std::byte{1});
  hello.message_size_max = 0;
  hello.version_min = hello.version_max = 2;
  hello.client_epoch = 0;
  const auto judged = [&] {
    return server.on_frame(peer.hello_frame(hello), peer.address, at(0s));
  };
  EXPECT_EQ(judged().action, Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadPayload), 1u);
  hello.client_epoch = peer.epoch;
  expect_refusal(judged(), peer, Status::kVersionUnsupported);
  hello.version_min = hello.version_max = kVersion;
  expect_refusal(judged(), peer, Status::kBadLimits);
  hello.message_size_max = kMessageSizeFloor;
  expect_refusal(judged(), peer, Status::kWrongBand);
  peer.priority = 100;
  const Verdict verdict = judged();
  ASSERT_EQ(header_of(verdict.frame).kind, FrameKind::kCookie);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadCookie), 1u);
  std::ranges::copy(payload_of(verdict.frame), hello.cookie.begin());
  expect_refusal(judged(), peer, Status::kOverload);
}

// hp-4.1-5
TEST(ServerHandshake, DoesNotMindWhetherAHelloIsCalledRepeated) {
  ServerSessions server(server_config());
  const Peer peer;
  Bytes frame = peer.proven_hello_frame(server, at(0s));
  store_le(frame.data() + 6, kFlagRepeated);
  EXPECT_EQ(header_of(server.on_frame(frame, peer.address, at(0s)).frame).kind,
            FrameKind::kWelcome);
}

// hp-4.1-1
TEST(ServerHandshake, DropsAHelloThatItCanNotRead) {
  ServerSessions server(server_config());
  const Peer peer;
  Bytes frame = peer.hello_frame();
  frame.back() = std::byte{1};
  EXPECT_EQ(server.on_frame(frame, peer.address, at(0s)).action, Action::kNothing);
  Hello hello = peer.hello();
  hello.client_epoch = 0;
  EXPECT_EQ(server.on_frame(peer.hello_frame(hello), peer.address, at(0s)).action,
            Action::kNothing);
  Header header;
  header.kind = FrameKind::kHello;
  EXPECT_EQ(server.on_frame(frame_of(header), peer.address, at(0s)).action, Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadPayload), 3u);
  EXPECT_EQ(server.counters().received_count, 3u);
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

TEST(ServerSessionTable, RefusesANewcomerWhileAllWereHeardLately) {
  ServerSessions server(server_config());
  const std::vector<Peer> peers = fill(server, 4);
  Peer newcomer;
  newcomer.channel = 99;
  const Header answer = newcomer.open(server, at(kSessionIdleMin - 1ns));
  EXPECT_EQ(answer.kind, FrameKind::kRefuse);
  EXPECT_EQ(answer.status, Status::kOverload);
  EXPECT_EQ(server.counters().session_evicted_count, 0u);
  EXPECT_EQ(server.session_count(), 4u);
  EXPECT_EQ(server.on_frame(peers[0].call_frame(1), peers[0].address, at(kSessionIdleMin)).action,
            Action::kDispatch);
}

TEST(ServerSessionTable, ReplacesTheSessionThatWasSilentLongest) {
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

// hp-5.5-1: a client that still repeats a call keeps its session.
TEST(ServerSessionTable, KeepsASessionThatCallsOrRepeats) {
  ServerSessions server(server_config());
  const std::vector<Peer> peers = fill(server, 4);
  const Verdict verdict = server.on_frame(peers[0].call_frame(1), peers[0].address, at(10s));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  const Bytes reply = answer(server, verdict.request, "", at(10s));
  EXPECT_EQ(server.on_frame(peers[0].call_frame(1), peers[0].address, at(20s)).action,
            Action::kSend)
      << "a copy";
  Peer newcomer;
  newcomer.channel = 99;
  newcomer.open(server, at(kSessionIdleMin + 1s));
  EXPECT_EQ(server.on_frame(peers[0].call_frame(2), peers[0].address, at(32s)).action,
            Action::kDispatch);
  const Verdict lost = server.on_frame(peers[1].call_frame(1), peers[1].address, at(32s));
  EXPECT_EQ(header_of(lost.frame).status, Status::kUnknownSession);
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
TEST(ServerSessionTable, GivesOneHostThreeQuartersOfItsPlaces) {
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
TEST(ServerSessionTable, LetsAHostWithItsShareReplaceOnlyItsOwn) {
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
  EXPECT_EQ(is_known(peers[1]) + is_known(peers[2]), 1) << "one of these made place";
}

// hp-4-7: a connection's address does not identify a host; the acceptor counts hosts.
TEST(ServerSessionTable, GivesConnectionsAllPlaces) {
  ServerSessions server(server_config(Medium::kStream));
  for (std::uint32_t i = 0; i < 4; ++i) {
    Peer peer;
    peer.address.port = i;
    EXPECT_EQ(peer.open(server, at(0s), Medium::kStream).kind, FrameKind::kWelcome);
  }
}

TEST(ServerSessionTable, RunsTheFirstCallsOfASessionInAReusedPlace) {
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

// hp-4.5-1
TEST(ServerSessionTable, EndsASessionAtItsClose) {
  ServerSessions server(server_config());
  Peer peer;
  peer.open(server, at(0s));
  Header close;
  close.kind = FrameKind::kClose;
  close.session = peer.session;
  PeerAddress stranger = peer.address;
  stranger.port = 1;
  EXPECT_EQ(server.on_frame(frame_of(close), stranger, at(1s)).action, Action::kNothing);
  EXPECT_EQ(server.session_count(), 1u);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kForeignAddress), 1u);

  EXPECT_EQ(server.on_frame(frame_of(close), peer.address, at(1s)).action, Action::kNothing);
  EXPECT_EQ(server.session_count(), 0u);
  const Verdict verdict = server.on_frame(peer.call_frame(1), peer.address, at(1s));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);

  EXPECT_EQ(server.on_frame(frame_of(close), peer.address, at(1s)).action, Action::kNothing)
      << "a copy";
  EXPECT_EQ(server.session_count(), 0u);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kUnknownSession), 2u);
}

TEST(ServerSessionTable, ForgetsTheSessionOfAConnectionThatEnded) {
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

TEST(ServerSessionTable, NeverGivesASessionNumberTwice) {
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

// hp-3-1
TEST(ServerFrames, OfAServersKindsAreDropped) {
  for (const Medium medium : {Medium::kDatagram, Medium::kStream}) {
    ServerSessions server(server_config(medium));
    for (const FrameKind kind : {FrameKind::kCookie, FrameKind::kWelcome, FrameKind::kRefuse,
                                 FrameKind::kReply, FrameKind::kItem}) {
      Header header;
      header.kind = kind;
      EXPECT_EQ(server.on_frame(frame_of(header), Peer{}.address, at(0s)).action, Action::kNothing);
    }
    EXPECT_EQ(server.counters().dropped_for(DropReason::kBadKind), 5u);
  }
}

// hp-8-2
TEST(ServerFrames, WithABadHeaderEndAStreamButNoDatagramPort) {
  Bytes frame = frame_of({});
  frame[0] = std::byte{0};
  ServerSessions datagrams(server_config(Medium::kDatagram));
  EXPECT_EQ(datagrams.on_frame(frame, Peer{}.address, at(0s)).action, Action::kNothing);
  EXPECT_EQ(datagrams.counters().dropped_for(DropReason::kBadMagic), 1u);
  ServerSessions stream(server_config(Medium::kStream));
  EXPECT_EQ(stream.on_frame(frame, Peer{}.address, at(0s)).action, Action::kHangUp);
  EXPECT_EQ(stream.counters().dropped_for(DropReason::kBadMagic), 1u);
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
TEST(ServerFrames, FromAnUnprovenAddressAreNeverAnsweredWithMoreBytes) {
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
