#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <ostream>
#include <string>
#include <thread>
#include <vector>

#include "noting_servant.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// The legal combinations of lanes, priority models and bands, and the priority at which each
// receives and runs: the table of ObjectOptions.
namespace rtpm::rpc {
namespace {

using namespace test;

constexpr Priority kPoolPriority = 5'000;
constexpr Priority kDeclared = 21'000;
constexpr Priority kCallers = 25'000;
constexpr Priority kOutside = 500;  ///< A priority in no band.
const std::vector<Band> kBands{{1'000, 4'000}, {20'000, 30'000}};

enum class Runs : std::uint8_t { kIllegal, kAtThePools, kAtTheDeclared, kAtTheCallers };

struct Row {
  bool has_lanes;
  PriorityModel model;
  bool has_bands;
  Runs runs;
  friend void PrintTo(const Row& row, std::ostream* out) {
    *out << (row.has_lanes ? "lanes" : "no lanes") << ", model " << static_cast<int>(row.model)
         << ", " << (row.has_bands ? "bands" : "no bands");
  }
};

constexpr std::array<Row, 12> kRows{{
    {true, PriorityModel::kNone, false, Runs::kIllegal},
    {true, PriorityModel::kNone, true, Runs::kIllegal},
    {true, PriorityModel::kServerDeclared, false, Runs::kAtTheDeclared},
    {true, PriorityModel::kServerDeclared, true, Runs::kAtTheDeclared},
    {true, PriorityModel::kClientPropagated, false, Runs::kAtTheCallers},
    {true, PriorityModel::kClientPropagated, true, Runs::kAtTheCallers},
    {false, PriorityModel::kNone, false, Runs::kAtThePools},
    {false, PriorityModel::kNone, true, Runs::kIllegal},
    {false, PriorityModel::kServerDeclared, false, Runs::kAtTheDeclared},
    {false, PriorityModel::kServerDeclared, true, Runs::kAtTheDeclared},
    {false, PriorityModel::kClientPropagated, false, Runs::kAtTheCallers},
    {false, PriorityModel::kClientPropagated, true, Runs::kAtTheCallers},
}};

ServerConfig config_of(bool has_lanes, bool has_right) {
  std::vector<LaneConfig> lanes{quiet_lane(0)};
  if (has_lanes) lanes.push_back(quiet_lane(20'000));
  lanes.front().priority = kPoolPriority;
  for (LaneConfig& lane : lanes)
    lane.buffered_request_max = 16;
  ServerConfig config = quiet_config(lanes);
  config.realtime = has_right ? rt::RealtimeMode::kRequire : rt::RealtimeMode::kOff;
  return config;
}

class PolicyTable : public testing::TestWithParam<Row> {};

TEST_P(PolicyTable, RunsCallsAtThePriorityOfTheRow) {
  const Row& row = GetParam();
  const bool has_right = rtpm::test::has_realtime_right();
  echo::Servant servant;
  auto server = std::move(*Server::create(config_of(row.has_lanes, has_right)));
  ObjectOptions options{row.model, kDeclared, row.has_bands ? kBands : std::vector<Band>{}};
  const auto added = server->add("echo", servant, options);
  ASSERT_EQ(added.has_value(), row.runs != Runs::kIllegal);
  if (!added) {
    expect_text(added.error().text(), {"server 'test'", "object 'echo'", "model", "Remedy"});
    return;
  }
  ASSERT_TRUE(server->start());
  Node node(quiet_node());
  auto binding = Binding::bind(node, server->url("echo"), echo::kInterface);
  ASSERT_TRUE(binding);
  const auto reply = binding->call(echo::kWhere, {}, {.priority = kCallers});
  ASSERT_TRUE(reply) << to_string(reply.error());
  echo::Place place{};
  std::memcpy(&place, reply->bytes().data(), sizeof place);
  Priority expected = kCallers;
  if (row.runs == Runs::kAtThePools) expected = kPoolPriority;
  if (row.runs == Runs::kAtTheDeclared) expected = kDeclared;
  EXPECT_EQ(place.priority, expected.value());
  EXPECT_EQ(place.current_priority, expected.value());
  const Priority receives = row.has_lanes ? Priority{20'000} : kPoolPriority;
  const std::string_view lane = place.thread_name.data();
  EXPECT_TRUE(lane.starts_with(row.has_lanes ? "lane-20000" : "lane-0")) << lane;
  if (has_right) {
    EXPECT_EQ(place.level, rt::to_native(expected));
    // The lane's other thread has received only at the lane's own priority.
    int level = 100;
    for (const pid_t id : rtpm::test::threads_named(row.has_lanes ? "lane-20000" : "lane-0")) {
      level = std::min(level, rtpm::test::effective_level(id));
    }
    EXPECT_EQ(level, rt::to_native(receives));
  }
  const auto outside = binding->call(echo::kEcho, {}, {.priority = kOutside});
  const bool is_refused = row.has_bands && row.model == PriorityModel::kClientPropagated;
  ASSERT_EQ(outside.has_value(), !is_refused);
  if (is_refused) {
    EXPECT_EQ(outside.error(), CallError::kWrongBand);
  }
  server->stop();
}

INSTANTIATE_TEST_SUITE_P(Rows, PolicyTable, testing::ValuesIn(kRows));

std::string error_of(bool has_lanes, const ObjectOptions& options, bool keeps_requests = true) {
  ServerConfig config = config_of(has_lanes, false);
  if (!keeps_requests) config.lanes.front().buffered_request_max = 0;
  echo::Servant servant;
  auto server = std::move(*Server::create(config));
  const auto added = server->add("echo", servant, options);
  return added ? "" : added.error().text();
}

TEST(Policy, RefusesADeclaredPriorityOutsideItsBands) {
  for (const bool has_lanes : {false, true}) {
    expect_text(error_of(has_lanes, {PriorityModel::kServerDeclared, kOutside, kBands}),
                {"declares priority 500", "none of its bands", "Remedy"});
  }
}

TEST(Policy, RefusesInvalidBands) {
  const auto error_with = [](std::vector<Band> bands) {
    return error_of(true, {PriorityModel::kClientPropagated, 0, std::move(bands)});
  };
  expect_text(error_with({{200, 100}}), {"a band from 200 to 100", "Remedy"});
  expect_text(error_with({{200, 300}, {100, 200}}), {"from 200 to 300 that overlaps", "Remedy"});
  expect_text(error_with(std::vector<Band>(17, Band{0, 1})), {"17 bands", "at most 16"});
}

TEST(Policy, RefusesBandsWithoutARequestBuffer) {
  expect_text(error_of(false, {PriorityModel::kClientPropagated, 0, kBands}, false),
              {"in the order in which they come", "buffered_request_max"});
}

// hp-5.8: a caller that sends without waiting for a result gets the error, too.
TEST(Policy, RefusesAReceiptOutsideOfAllBands) {
  EchoServer server(config_of(true, false), {PriorityModel::kClientPropagated, 0, kBands});
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto sent = binding.send(echo::kEcho, {}, wire::Delivery::kReceipt, {.priority = kOutside});
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), CallError::kWrongBand);
  EXPECT_EQ(server.servant.run_count(), 0);
}

// With and without lanes, with and without bands: an urgent call never waits for a less urgent one.
TEST(Policy, NeverInvertsPriorities) {
  for (const bool has_lanes : {false, true}) {
    for (const bool has_bands : {false, true}) {
      NotingServant servant;
      const auto server =
          rtpm::test::serve("echo", servant, config_of(has_lanes, false),
                            ObjectOptions{PriorityModel::kClientPropagated, 0,
                                          has_bands ? kBands : std::vector<Band>{}});
      Node node(quiet_node());
      auto binding = Binding::bind(node, server->url("echo"), echo::kInterface);
      ASSERT_TRUE(binding);
      std::vector<std::thread> threads;
      const auto call = [&](const MethodDescriptor& method, Priority priority) {
        threads.emplace_back(
            [&, priority] { EXPECT_TRUE(binding->call(method, {}, {.priority = priority})); });
      };
      call(echo::kHold, 2'000);
      ASSERT_TRUE(await([&] { return servant.gate.inside_count() == 1; }));
      for (std::uint64_t count = 1; count <= 5; ++count) {
        call(echo::kEcho, 2'000);
        ASSERT_TRUE(await([&] { return server->counters().queued_count_max == count; }));
      }
      if (has_lanes) {
        EXPECT_TRUE(binding->call(echo::kEcho, {}, {.priority = kCallers})) << "at once";
      } else {
        call(echo::kEcho, kCallers);
        ASSERT_TRUE(await([&] { return server->counters().queued_count_max == 6; }));
      }
      servant.gate.open();
      for (std::thread& thread : threads)
        thread.join();
      ASSERT_EQ(servant.order().size(), 6);
      EXPECT_EQ(servant.order().front(), kCallers.value());
      server->stop();
    }
  }
}

TEST(PriorityTransforms, ChangeInboundAndOutboundPriorities) {
  ServerConfig config = quiet_config({quiet_lane(0), quiet_lane(20'000)});
  config.inbound_priority = [](Priority priority, std::string_view path) -> Priority {
    return path == "echo" ? Priority{priority.value() + 1} : priority;
  };
  EchoServer server(std::move(config));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const echo::Place inbound = place_of(binding, {.priority = 19'999});
  EXPECT_EQ(inbound.priority, 20'000);
  EXPECT_STREQ(inbound.thread_name.data(), "lane-0") << "the call's own priority chose the lane";

  NodeConfig node_config = quiet_node();
  node_config.outbound_priority = [](Priority priority, std::string_view path) -> Priority {
    return path == "echo" ? Priority{priority.value() + 20'000} : priority;
  };
  Node changed_node(node_config);
  Binding changed = bind_echo(changed_node, server);
  const echo::Place outbound = place_of(changed, {.priority = 100});
  EXPECT_EQ(outbound.priority, 20'101);
  EXPECT_STREQ(outbound.thread_name.data(), "lane-20000");
}

/// Calls another object and returns its report about itself.
class NestingServant final : public Servant {
 public:
  explicit NestingServant(Binding& inner) : inner_(inner) {}
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes reply,
                          const CallContext& context) override {
    deadline_ns = to_ns(context.deadline);
    const auto inner = inner_.call(echo::kWhere, {});
    if (!inner) return {wire::Status::kServantFailed, 0};
    std::memcpy(reply.data(), inner->bytes().data(), inner->bytes().size());
    return {wire::Status::kOk, static_cast<std::uint32_t>(inner->bytes().size())};
  }
  std::atomic<std::int64_t> deadline_ns{0};

 private:
  Binding& inner_;
};

TEST(NestedCalls, InheritPriorityTraceAndTheRemainingDeadline) {
  EchoServer inner_server;
  Node inner_node(quiet_node());
  Binding inner = bind_echo(inner_node, inner_server);
  for (const std::uint32_t buffered : {0U, 8U}) {
    NestingServant outer_servant(inner);
    LaneConfig lane = quiet_lane();
    lane.buffered_request_max = buffered;
    const auto outer_server = rtpm::test::serve("outer", outer_servant, quiet_config({lane}));
    Node node(quiet_node());
    auto outer = Binding::bind(node, outer_server->url("outer"), echo::kInterface);
    ASSERT_TRUE(outer);
    const echo::Place place =
        place_of(*outer, {.priority = 12'345, .deadline = std::chrono::seconds{5}, .trace_id = 77});
    EXPECT_EQ(place.priority, 12'345);
    EXPECT_EQ(place.trace_id, 77);
    // The frame carries the remaining time, so transit time reduces it, and it never grows.
    EXPECT_GT(place.deadline_ns, 0);
    EXPECT_LE(place.deadline_ns, outer_servant.deadline_ns.load() + 1'000'000);
    outer_server->stop();
  }
}

TEST(Bind, OpensEveryBandOfTheServer) {
  EchoServer server(quiet_config({quiet_lane(0), quiet_lane(10'000), quiet_lane(20'000)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto opened = [&] { return server.server->counters().frames.session_opened_count; };
  EXPECT_TRUE(await([&] { return opened() == 3; }));
  for (const Priority priority : {0, 10'000, 32'767})
    EXPECT_TRUE(binding.call(echo::kEcho, {}, {.priority = priority}));
  EXPECT_EQ(opened(), 3) << "no call had to open one";
}

TEST(Bind, OpensNoBandAboveTheServersCeiling) {
  ServerConfig config = quiet_config({quiet_lane(0), quiet_lane(10'000), quiet_lane(20'000)});
  config.ceiling = 15'000;
  EchoServer server(std::move(config));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, {}, {.priority = 15'000}));
  EXPECT_TRUE(await([&] { return server.server->counters().frames.session_opened_count == 2; }));
}

TEST(Bind, GivesAPrivateBindingItsOwnChannels) {
  EchoServer server;
  Node node(quiet_node());
  Binding shared = bind_echo(node, server);
  Binding also_shared = bind_echo(node, server);
  EXPECT_EQ(place_of(shared, {}).session, place_of(also_shared, {}).session);
  std::uint64_t session = 0;
  {
    Binding own = bind_echo(node, server, {.is_private = true});
    Binding other = bind_echo(node, server, {.is_private = true});
    session = place_of(own, {}).session;
    EXPECT_NE(session, place_of(shared, {}).session);
    EXPECT_NE(session, place_of(other, {}).session);
  }
  Binding next = bind_echo(node, server, {.is_private = true});
  EXPECT_EQ(place_of(next, {}).session, session) << "the next private binding may reuse them";
}

}  // namespace
}  // namespace rtpm::rpc
