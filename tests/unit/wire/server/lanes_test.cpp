#include <gtest/gtest.h>

#include "peers.hpp"

// The lanes of one server, which share a key but no state: spec/hprotocol.md#hp-4.4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

ServerSessionsConfig lane_config(std::uint32_t lane, std::uint32_t lane_count = 2) {
  ServerSessionsConfig config = server_config();
  config.lane = lane;
  config.lane_count = lane_count;
  config.band = lane == 0 ? Band{0, 999} : Band{1000, Priority::kHighest};
  return config;
}

class Lanes : public testing::Test {
 protected:
  void SetUp() override { peer_.open(low_, at(0s)); }

  /// A frame of the peer's session that carries a priority of the higher lane.
  Verdict to_high(Header header, const Bytes& payload = {}) {
    header.priority = 2000;
    return high_.on_frame(frame_of(header, payload), peer_.address, at(0s));
  }
  void expect_refusal(const Verdict& verdict, Status status) const {
    ASSERT_EQ(verdict.action, Action::kSend);
    EXPECT_EQ(verdict.frame.size(), kHeaderSize);
    const Header header = header_of(verdict.frame);
    EXPECT_EQ(header.kind, FrameKind::kRefuse);
    EXPECT_EQ(header.status, status);
    EXPECT_EQ(header.session, peer_.session);
    EXPECT_EQ(header.priority, 2000);
  }

  ServerSessions low_{lane_config(0)};
  ServerSessions high_{lane_config(1)};
  Peer peer_;
};

// hp-4.4-4
TEST_F(Lanes, TellASessionOfAnotherLaneFromAnUnknownOne) {
  for (std::uint32_t copy = 0; copy < 3; ++copy) {
    expect_refusal(to_high(peer_.call_header(7)), Status::kWrongBand);
  }
  EXPECT_EQ(high_.counters().refused_count, 3u);
  EXPECT_EQ(high_.counters().dropped_for(DropReason::kUnknownSession), 0u);
  EXPECT_EQ(low_.on_frame(peer_.call_frame(7), peer_.address, at(0s)).action, Action::kDispatch)
      << "the session is good, and the number is free";
}

// hp-4.4-4
TEST_F(Lanes, RefuseACreditOfAnotherLanesSession) {
  Header credit = header_about(peer_.call_header(7), FrameKind::kCredit, StreamCredit::kSize, {});
  Bytes payload(StreamCredit::kSize);
  encode(StreamCredit{}, payload);
  expect_refusal(to_high(credit, payload), Status::kWrongBand);
}

// hp-5.8-1
TEST_F(Lanes, DoNotAnswerAOnewayOfAnotherLanesSession) {
  Header oneway = peer_.call_header(7);
  oneway.flags = kFlagNoReply;
  EXPECT_EQ(to_high(oneway).action, Action::kNothing);
  EXPECT_EQ(high_.counters().refused_count, 1u);
}

TEST_F(Lanes, DropWhatIsNotAnswered) {
  for (const FrameKind kind : {FrameKind::kClose, FrameKind::kCancel}) {
    EXPECT_EQ(to_high(header_about(peer_.call_header(7), kind, 0, {})).action, Action::kNothing);
  }
  EXPECT_EQ(high_.counters().dropped_for(DropReason::kUnknownSession), 2u);
  EXPECT_EQ(low_.session_count(), 1u) << "a CLOSE in the wrong lane ends nothing";
}

// hp-4.4-1
TEST_F(Lanes, KnowNoSessionThatTheyForgot) {
  Peer own;
  own.priority = 2000;
  own.open(high_, at(0s));
  Header close;
  close.kind = FrameKind::kClose;
  close.session = own.session;
  static_cast<void>(high_.on_frame(frame_of(close), own.address, at(0s)));
  peer_.session = own.session;
  expect_refusal(to_high(peer_.call_header(1)), Status::kUnknownSession);
}

// hp-4.4-1
TEST_F(Lanes, KnowNoSessionOfAnotherLife) {
  ServerSessionsConfig key = lane_config(1);
  ++key.key.low;
  ServerSessionsConfig epoch = lane_config(1);
  ++epoch.epoch;
  for (const ServerSessionsConfig& config : {key, epoch}) {
    ServerSessions next(config);
    Header header = peer_.call_header(1);
    header.priority = 2000;
    expect_refusal(next.on_frame(frame_of(header), peer_.address, at(0s)), Status::kUnknownSession);
  }
}

// hp-4.4-1: almost no random number is mistaken for another lane's session.
TEST(LaneNumbers, AreNotGuessed) {
  Random random(1);
  ServerSessions lane(lane_config(1, 64));
  Peer peer;
  for (int i = 0; i < 20'000; ++i) {
    peer.session = random();
    const Verdict verdict = lane.on_frame(peer.call_frame(1), peer.address, at(i * 2ms));
    ASSERT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
  }
}

TEST(LaneNumbers, DifferBetweenLanes) {
  ServerSessions low(lane_config(0));
  ServerSessions high(lane_config(1));
  Peer peer;
  peer.open(low, at(0s));
  const std::uint64_t first = peer.session;
  peer.priority = 2000;
  peer.open(high, at(0s));
  EXPECT_NE(peer.session >> 40, first >> 40) << "numbers must not be guessed from one another";
}

}  // namespace
}  // namespace rtpm::wire
