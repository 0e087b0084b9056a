#include "peers.hpp"
#include "rtpm/wire/rate_limiter.hpp"

// Datagrams without a session: how many of them are answered.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

constexpr PeerAddress kHost{.low = 1, .port = 5};

TEST(RateLimiter, AdmitsABurstAndThenOneEachInterval) {
  RateLimiter limiter({1, 2}, 3, 10ms);
  for (int i = 0; i < 3; ++i)
    EXPECT_TRUE(limiter.admit(kHost, at(0s)));
  EXPECT_FALSE(limiter.admit(kHost, at(0s)));
  EXPECT_FALSE(limiter.admit(kHost, at(10ms - 1ns)));
  EXPECT_TRUE(limiter.admit(kHost, at(10ms)));
  EXPECT_FALSE(limiter.admit(kHost, at(10ms)));
  // An idle host saves up one burst at most.
  for (int i = 0; i < 3; ++i)
    EXPECT_TRUE(limiter.admit(kHost, at(10s)));
  EXPECT_FALSE(limiter.admit(kHost, at(10s)));
}

TEST(RateLimiter, LimitsByHostAndNotByPort) {
  RateLimiter limiter({1, 2}, 1, 1s);
  EXPECT_TRUE(limiter.admit(kHost, at(0s)));
  EXPECT_FALSE(limiter.admit({.low = 1, .port = 6}, at(0s)));
  // hp-4-7
  EXPECT_TRUE(limiter.admit({.high = 7, .low = 1}, at(0s)));
  EXPECT_FALSE(limiter.admit({.high = 7, .low = 2}, at(0s))) << "of the same /64";
  // Hosts share a fixed table, so that a few of many collide.
  int admitted_count = 0;
  for (std::uint64_t host = 2; host < 34; ++host)
    admitted_count += limiter.admit({.low = host}, at(0s)) ? 1 : 0;
  EXPECT_GT(admitted_count, 16);
}

class Strangers : public testing::Test {
 protected:
  Verdict call(const PeerAddress& from, MonotonicTime now) {
    Peer peer;
    peer.session = 0x1234'0000'0000;
    return server_.on_frame(peer.call_frame(1), from, now);
  }
  std::uint64_t dropped(DropReason reason) const { return server_.counters().dropped_for(reason); }

  ServerSessions server_{server_config()};
};

// hp-4.4-5: calls of unknown sessions cost the lane only a check, even in a flood.
TEST_F(Strangers, AreAnsweredAtALimitedRate) {
  for (std::uint32_t i = 0; i < kStrangerAnswerBurst; ++i) {
    const Verdict verdict = call({.low = 1, .port = i}, at(0s));
    ASSERT_EQ(verdict.action, Action::kSend);
    EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
  }
  for (std::uint32_t i = 0; i < 1000; ++i)
    ASSERT_EQ(call({.low = 1, .port = i}, at(0s)).action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnknownSession), kStrangerAnswerBurst);
  EXPECT_EQ(dropped(DropReason::kRateLimited), 1000u);
  EXPECT_EQ(server_.counters().refused_count, kStrangerAnswerBurst);
  // The client's repetition is answered (hp-5.3-1).
  EXPECT_EQ(call(kHost, at(kStrangerAnswerInterval)).action, Action::kSend);
  EXPECT_EQ(call(kHost, at(kStrangerAnswerInterval)).action, Action::kNothing);
  EXPECT_EQ(call({.low = 2, .port = 1}, at(0s)).action, Action::kSend) << "of another host";
}

// hp-4.4-5: answers to a session's own frames do not count.
TEST_F(Strangers, DoNotAffectSessionsOfTheirHost) {
  Peer peer;
  peer.open(server_, at(0s));
  for (std::uint32_t i = 0; i < 1000; ++i)
    static_cast<void>(call(peer.address, at(0s)));
  const Verdict verdict = server_.on_frame(peer.call_frame(1), peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_EQ(payload_of(answer(server_, verdict.request, "here", at(0s))), bytes_of("here"));
}

// hp-4.4-5, hp-4-5: answers to HELLOs are limited, too, but one with a valid cookie gets its own.
TEST_F(Strangers, GetCookiesAtALimitedRate) {
  Peer peer;
  const Bytes proven = peer.proven_hello_frame(server_, at(0s));
  for (std::uint32_t i = 1; i < kStrangerAnswerBurst; ++i) {
    ASSERT_EQ(server_.on_frame(peer.hello_frame(), peer.address, at(0s)).action, Action::kSend);
  }
  EXPECT_EQ(server_.on_frame(peer.hello_frame(), peer.address, at(0s)).action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kRateLimited), 1u);
  const Verdict welcome = server_.on_frame(proven, peer.address, at(0s));
  EXPECT_EQ(header_of(welcome.frame).kind, FrameKind::kWelcome);
  EXPECT_EQ(server_.on_frame(peer.hello_frame(), peer.address, at(5ms)).action, Action::kSend);
}

// Over a connection there are no repetitions and no forged addresses.
TEST(StrangersOnAStream, AreAlwaysAnswered) {
  ServerSessions server(server_config(Medium::kStream));
  Peer peer;
  peer.session = 0x1234'0000'0000;
  for (std::uint32_t i = 0; i < 2 * kStrangerAnswerBurst; ++i) {
    ASSERT_EQ(server.on_frame(peer.call_frame(i), peer.address, at(0s)).action, Action::kSend);
  }
}

// hp-4.1-5: a full server refuses with overload, unless the HELLO has another fault.
TEST(Newcomers, AreRefusedByAFullServer) {
  ServerSessions server(server_config(Medium::kStream));
  Peer peer;
  const Header refusal = header_of(server.turn_away(peer.hello_frame(), at(0s)));
  EXPECT_EQ(refusal.kind, FrameKind::kRefuse);
  EXPECT_EQ(refusal.status, Status::kOverload);
  EXPECT_EQ(refusal.call_id, peer.handshake_number);
  Hello later = peer.hello();
  later.version_min = later.version_max = kVersion + 1;
  EXPECT_EQ(header_of(server.turn_away(peer.hello_frame(later), at(0s))).status,
            Status::kVersionUnsupported);
  EXPECT_TRUE(server.turn_away(peer.call_frame(1), at(0s)).empty());
  EXPECT_TRUE(server.turn_away(Bytes(64), at(0s)).empty());
  EXPECT_FALSE(server.has_session(peer.address));
  peer.open(server, at(0s), Medium::kStream);
  EXPECT_TRUE(server.has_session(peer.address));
}

}  // namespace
}  // namespace rtpm::wire
