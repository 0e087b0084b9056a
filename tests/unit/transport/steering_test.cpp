#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frames.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"

// hp-11-2: each datagram reaches the socket of the lane that serves its priority.
namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

class Lanes {
 public:
  explicit Lanes(const std::vector<Priority>& lows, const std::string& host = "127.0.0.1",
                 const std::string& called = "127.0.0.1")
      : lows_(lows) {
    const auto listener = TcpListener::open(called, 0);
    number_ = listener->port();
    std::vector<LanePortConfig> lanes;
    for (const Priority low : lows)
      lanes.push_back({.low = low});
    auto ports = open_lane_ports({.host = host, .port = number_}, lanes, rt::RealtimeMode::kOff);
    EXPECT_TRUE(ports) << ports.error().text();
    ports_ = std::move(*ports);
    transport_ = std::move(*open_udp_transport(called, number_, 0));
  }

  /// The lane that gets the datagram; nullopt if none does.
  std::optional<std::size_t> lane_of(ConstBytes datagram) {
    EXPECT_TRUE(transport_->send(datagram));
    std::optional<std::size_t> lane;
    static_cast<void>(rtpm::test::await([&] {
      for (std::size_t i = 0; i < ports_.size(); ++i) {
        Bytes buffer(2000);
        if (ports_[i].receive(buffer)) lane = i;
      }
      return lane.has_value();
    }));
    return lane;
  }
  std::optional<std::size_t> lane_of_priority(int priority) {
    return lane_of(frame_of(48, priority));
  }
  /// Expects that a lane's wake() reaches this lane only.
  void expect_woken(std::size_t lane) {
    ports_[lane].wake();
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      ASSERT_TRUE(transport_->send(frame_of(48, lows_[i])));
      Bytes buffer(2000);
      // Datagrams keep their order, so that the wake-up precedes this one.
      if (i == lane) {
        EXPECT_FALSE(ports_[i].await(buffer)) << lane << " was not woken";
      }
      EXPECT_TRUE(ports_[i].await(buffer)) << i << " was woken for " << lane;
      EXPECT_TRUE(ports_[i].receive(buffer));
    }
  }

 private:
  std::uint16_t number_ = 0;
  std::vector<Priority> lows_;
  std::vector<UdpPort> ports_;
  std::unique_ptr<ClientTransport> transport_;
};

TEST(Steering, DeliversEachPriorityToItsLane) {
  Lanes lanes({0, 100, 255, 256, 20'000});
  const std::vector<std::pair<int, std::size_t>> expected_lanes{
      {0, 0},   {1, 0},      {99, 0},     {100, 1},    {101, 1},    {254, 1},   {255, 2},
      {256, 3}, {19'999, 3}, {20'000, 4}, {20'001, 4}, {32'766, 4}, {32'767, 4}};
  for (const auto& [priority, lane] : expected_lanes) {
    EXPECT_EQ(lanes.lane_of_priority(priority), lane) << priority;
  }
}

/// The hosts that a server may be told, and the addresses at which it is then called.
std::vector<std::pair<std::string, std::string>> hosts_and_called() {
  std::vector<std::pair<std::string, std::string>> each{{"127.0.0.1", "127.0.0.1"},
                                                        {"any", "127.0.0.1"}};
  if (TcpListener::open("::1", 0)) each.insert(each.end(), {{"any", "::1"}, {"::1", "::1"}});
  return each;
}

TEST(Steering, WakesInBothFamilies) {
  for (const auto& [host, called] : hosts_and_called()) {
    Lanes lanes({0, 100, 20'000}, host, called);
    for (std::size_t lane = 0; lane < 3; ++lane)
      lanes.expect_woken(lane);
  }
}

TEST(Steering, DeliversInBothFamilies) {
  for (const auto& [host, called] : hosts_and_called()) {
    Lanes lanes({0, 100, 20'000}, host, called);
    EXPECT_EQ(lanes.lane_of_priority(99), 0u) << host << " at " << called;
    EXPECT_EQ(lanes.lane_of_priority(100), 1u) << host << " at " << called;
    EXPECT_EQ(lanes.lane_of_priority(20'000), 2u) << host << " at " << called;
  }
}

TEST(Steering, WorksForOneLaneAndForTheMostLanes) {
  Lanes one({0});
  EXPECT_EQ(one.lane_of_priority(Priority::kHighest), 0u);
  std::vector<Priority> lows;
  for (int i = 0; i < 64; ++i)
    lows.push_back(i * 500);
  Lanes lanes(lows);
  for (int i = 0; i < 64; ++i) {
    EXPECT_EQ(lanes.lane_of_priority(i * 500), static_cast<std::size_t>(i));
    EXPECT_EQ(lanes.lane_of_priority(i * 500 + 499), static_cast<std::size_t>(i));
  }
}

// Garbage has the lowest priority.
TEST(Steering, DeliversFramesWithoutAPriorityToTheLowestLane) {
  Lanes lanes({0, 100, 20'000});
  for (std::size_t size = 0; size < 6; ++size) {
    EXPECT_EQ(lanes.lane_of(Bytes(size, std::byte{0xff})), 0u) << size << " bytes";
  }
  for (const int beyond : {32'768, 40'000, 65'535}) {
    Bytes frame = frame_of(0);
    store_le(frame.data() + 4, static_cast<std::uint16_t>(beyond));
    EXPECT_EQ(lanes.lane_of(frame), 0u) << beyond;
  }
}

}  // namespace
}  // namespace rtpm::transport
