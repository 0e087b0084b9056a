#include <gtest/gtest.h>

#include "peers.hpp"

// The lanes of one server, which share a key but no state: spec/hprotocol.md#hp-4.4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

ServerSessionsConfig lane_config(std::uint32_t lane, std::uint32_t lane_count = 2) {
  ServerSessionsConfig config = server_config();
  config.lane = lane;
  config.lane_count = lane_count;
  config.band = lane == 0 ? Band{0, 999} : Band{1000, Priority::kHighest};
  return config;
}

// hp-4.4-1
TEST(Lanes, KnowNoSessionUnderAnotherKey) {
  ServerSessions low(lane_config(0));
  Peer peer;
  peer.open(low, at(0s));
  peer.priority = 2000;
  ServerSessionsConfig config = lane_config(1);
  ++config.key.low;
  ServerSessions next(config);
  const Verdict verdict = next.on_frame(peer.call_frame(1), peer.address, at(0s));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
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
