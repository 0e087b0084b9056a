#include <string_view>
#include <thread>

#include "rtpm/rt/priority.hpp"
#include "rtpm/test/os.hpp"
#include "suite.hpp"

// The priority and the thread with which a call runs.   Source: spec/hprotocol.md#hp-11.
namespace rtpm::rpc::test {
namespace {

constexpr int kLow = 1'000;
constexpr int kHigh = 25'000;

/// Three lanes; of the urgent ones, one has its own name and one the default.
ServerConfig three_lanes(rt::RealtimeMode mode = rt::RealtimeMode::kOff) {
  LaneConfig urgent = quiet_lane(20'000);
  urgent.name = "urgent";
  ServerConfig config = quiet_config({quiet_lane(0), quiet_lane(10'000), urgent});
  config.realtime = mode;
  return config;
}

// The further threads of a lane have a number after its name.
std::string_view lane_name(const echo::Place& place) {
  const std::string_view name = place.thread_name.data();
  return name.substr(0, name.find('/'));
}

/// The system's report of where the servant ran.
rtpm::test::Scheduling scheduling(const echo::Place& place) {
  return {place.policy, place.level};
}

}  // namespace

TEST_P(TransportSuite, RunsACallAtTheCallersPriority) {
  EchoServer server(three_lanes());
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  for (const int priority : {0, kLow, 9'999, 10'000, 20'000, kHigh, 32'767, 0}) {
    const echo::Place place = place_of(binding, {.priority = priority});
    EXPECT_EQ(place.priority, priority);
    EXPECT_EQ(place.current_priority, priority) << "what the servant calls in turn has it, too";
  }
}

TEST_P(TransportSuite, RunsACallAtTheCallersFifoLevel) {
  if (!rtpm::test::has_realtime_right()) GTEST_SKIP() << rtpm::test::kNoRealtimeRight;
  EchoServer server(three_lanes(rt::RealtimeMode::kRequire));
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  // Priorities go up and down, within a lane and from lane to lane.
  for (const int priority : {0, kLow, 9'999, kLow, 20'000, kHigh, 32'767, kHigh, 0, 32'767}) {
    const echo::Place place = place_of(binding, {.priority = priority});
    EXPECT_EQ(scheduling(place), rtpm::test::fifo(rt::to_native(priority))) << priority;
  }
}

// A low lane may be kept off the real-time levels, whatever its callers' priorities say.
TEST_P(TransportSuite, RunsTheCallsOfATimeSharedLaneTimeShared) {
  if (!rtpm::test::has_realtime_right()) GTEST_SKIP() << rtpm::test::kNoRealtimeRight;
  ServerConfig config = three_lanes(rt::RealtimeMode::kRequire);
  config.lanes.front().schedule = rt::Schedule::kTimeShared;
  EchoServer server(config);
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  for (const int priority : {0, kLow, 9'999, 0}) {
    const echo::Place place = place_of(binding, {.priority = priority});
    EXPECT_EQ(scheduling(place), rtpm::test::kTimeShared) << priority;
    EXPECT_EQ(place.priority, priority) << "which what the servant calls in turn has all the same";
  }
  EXPECT_EQ(scheduling(place_of(binding, {.priority = kHigh})),
            rtpm::test::fifo(rt::to_native(kHigh)));
}

TEST_P(TransportSuite, TakesThePriorityOfTheCallingThread) {
  EchoServer server(three_lanes());
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::thread([&] {
    rt::adopt_priority(kHigh);
    EXPECT_EQ(place_of(binding).priority, kHigh);
    EXPECT_EQ(place_of(binding, {.priority = kLow}).priority, kLow) << "the call's own comes first";
    EXPECT_EQ(place_of(binding).priority, kHigh);
  }).join();
}

// hp-6.1-3
TEST_P(TransportSuite, GivesACallerWithoutAPriorityTheObjects) {
  EchoServer server(three_lanes(), {.priority = 12'345});
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const echo::Place place = place_of(binding);
  EXPECT_EQ(place.priority, 12'345);
  EXPECT_EQ(lane_name(place), "lane-10000");
  EXPECT_EQ(place_of(binding, {.priority = kHigh}).priority, kHigh);
}

// hp-6.1-3: the lane shows the priority with which the client sent it.
TEST_P(TransportSuite, RunsADeclaredObjectAtItsOwnPriority) {
  const bool has_right = rtpm::test::has_realtime_right();
  EchoServer server(three_lanes(has_right ? rt::RealtimeMode::kRequire : rt::RealtimeMode::kOff),
                    {.model = PriorityModel::kServerDeclared, .priority = 12'345});
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  for (const CallOptions& options :
       {CallOptions{}, CallOptions{.priority = 0}, CallOptions{.priority = kHigh}}) {
    const echo::Place place = place_of(binding, options);
    EXPECT_EQ(place.priority, 12'345);
    EXPECT_EQ(lane_name(place), "lane-10000") << "whatever the caller's is";
    const auto declared = rtpm::test::fifo(rt::to_native(12'345));
    EXPECT_EQ(scheduling(place), has_right ? declared : rtpm::test::kTimeShared);
  }
}

// hp-11-2
TEST_P(TransportSuite, RunsEachCallOnTheThreadOfItsLane) {
  EchoServer server(three_lanes());
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const echo::Place low = place_of(binding, {.priority = 0});
  const echo::Place middle = place_of(binding, {.priority = 10'000});
  const echo::Place high = place_of(binding, {.priority = 20'000});
  EXPECT_EQ(lane_name(low), "lane-0");
  EXPECT_EQ(lane_name(middle), "lane-10000");
  EXPECT_EQ(lane_name(high), "urgent");
  EXPECT_EQ(lane_name(place_of(binding, {.priority = 9'999})), lane_name(low));
  EXPECT_EQ(lane_name(place_of(binding, {.priority = 19'999})), lane_name(middle));
  EXPECT_EQ(lane_name(place_of(binding, {.priority = 32'767})), lane_name(high));
}

TEST_P(TransportSuite, ServesAnUrgentCallWhileALowLaneIsBusy) {
  EchoServer server(three_lanes());
  Node node(node_config());
  Binding binding = bind_echo(node, server, {.warm_up = {kLow, kHigh}});
  std::thread low([&] { EXPECT_TRUE(binding.call(echo::kHold, {}, {.priority = kLow})); });
  await_inside(server);
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(binding.call(echo::kEcho, {}, {.priority = kHigh}));
  }
  EXPECT_EQ(server.servant.gate().inside_count(), 1);
  server.servant.gate().let_one_go();
  low.join();
}

TEST_P(TransportSuite, RefusesCallsAboveTheCeiling) {
  ServerConfig config = three_lanes();
  config.ceiling = 20'500;
  EchoServer server(config);
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  EXPECT_EQ(place_of(binding, {.priority = 20'500}).priority, 20'500);
  expect_error(binding.call(echo::kEcho, {}, {.priority = 20'501}), CallError::kPriorityNotAllowed);
  expect_error(binding.call(echo::kEcho, {}, {.priority = 32'767}), CallError::kPriorityNotAllowed);
  EXPECT_EQ(server.servant.run_count(), 1);
}

}  // namespace rtpm::rpc::test
