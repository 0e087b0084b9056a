#include <algorithm>
#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include "rtpm/wire/clock_sync.hpp"
#include "suite.hpp"

// Calls that find their servant, and calls that are refused with a reason.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

std::string text_of_size(std::size_t size, std::uint32_t salt) {
  std::string text(size, '\0');
  for (std::size_t i = 0; i < size; ++i)
    text[i] = static_cast<char>(salt + i * 7);
  return text;
}

}  // namespace

TEST_P(TransportSuite, CarriesMessagesOfAllSizes) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::vector<std::size_t> sizes{0, 1, 2, 15, 16, 17, 47, 48, 49, 63, 64, 65, 1000};
  for (std::size_t size = 2000; size < 2 * 1024 * 1024; size *= 2)
    sizes.push_back(size);
  // The sizes are around the largest in one frame, and the largest of all.
  for (const std::size_t size :
       {frame_payload_max() - 1, frame_payload_max(), frame_payload_max() + 1,
        2 * frame_payload_max(), message_size_max()}) {
    sizes.push_back(size);
  }
  std::uint32_t salt = 0;
  for (const std::size_t size : sizes) {
    const std::string text = text_of_size(size, ++salt);
    const auto reply = binding.call(echo::kEcho, bytes_of(text), {.deadline = 30s});
    ASSERT_TRUE(reply) << size << " bytes: " << to_string(reply.error());
    EXPECT_EQ(text_of(*reply), text) << size << " bytes";
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reply->bytes().data()) % 16, 0u);
  }
}

TEST_P(TransportSuite, RefusesARequestThatIsTooLargeWithoutRunningIt) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const std::string text(message_size_max() + 1, 'x');
  expect_error(binding.call(echo::kEcho, bytes_of(text)), CallError::kTooLarge);
  EXPECT_EQ(server.servant.run_count(), 0);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("small")));
}

TEST_P(TransportSuite, ReportsAReplyThatIsTooLarge) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::array<std::byte, 4> size{};
  store_le(size.data(), static_cast<std::uint32_t>(message_size_max()));
  {
    const auto largest = binding.call(echo::kGrow, size, {.deadline = 30s});
    ASSERT_TRUE(largest);
    EXPECT_EQ(largest->bytes().size(), message_size_max());
  }
  store_le(size.data(), static_cast<std::uint32_t>(message_size_max() + 1));
  expect_error(binding.call(echo::kGrow, size, {.deadline = 30s}), CallError::kTooLarge);
  EXPECT_EQ(server.servant.run_count(), 2) << "it ran";
}

TEST_P(TransportSuite, KeepsTheSmallerLimitOfBothSides) {
  ServerConfig config = quiet_config();
  config.message_size_max = 2000;
  EchoServer server(config);
  NodeConfig modest = node_config();
  modest.message_size_max = 1024;
  for (const auto& [node_limits, limit] :
       {std::pair{node_config(), std::size_t{2000}}, std::pair{modest, std::size_t{1024}}}) {
    Node node(node_limits);
    Binding binding = bind_echo(node, server);
    EXPECT_TRUE(binding.call(echo::kEcho, bytes_of(std::string(limit, 'x'))));
    expect_error(binding.call(echo::kEcho, bytes_of(std::string(limit + 1, 'x'))),
                 CallError::kTooLarge);
    std::array<std::byte, 4> size{};
    store_le(size.data(), static_cast<std::uint32_t>(limit + 1));
    expect_error(binding.call(echo::kGrow, size), CallError::kTooLarge);
  }
}

// hp-6.2-1
TEST_P(TransportSuite, ReportsTheServersClock) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const auto clock = binding.ping();
  ASSERT_TRUE(clock) << to_string(clock.error());
  EXPECT_EQ(clock->offset, Duration{0}) << "one host has one clock";
  EXPECT_EQ(clock->uncertainty, Duration{0});
  EXPECT_EQ(server.servant.run_count(), 0);
}

// hp-5.6-5
TEST_P(TransportSuite, CarriesLargeMessagesOfSeveralCallersAtATime) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::array<std::thread, 3> callers;
  std::atomic<int> wrong_count{0};
  for (std::size_t i = 0; i < callers.size(); ++i) {
    callers[i] = std::thread([&, i] {
      for (std::uint32_t round = 0; round < 10; ++round) {
        const std::string text = text_of_size(100'000 + 1000 * i, round);
        const auto reply = binding.call(echo::kEcho, bytes_of(text), {.deadline = 30s});
        // With all buffers taken, the server refuses, and the caller may try again.
        const bool is_refused = !reply && reply.error() == CallError::kOverload;
        if (!is_refused && (!reply || text_of(*reply) != text)) ++wrong_count;
      }
    });
  }
  for (std::thread& caller : callers)
    caller.join();
  EXPECT_EQ(wrong_count, 0);
}

TEST_P(TransportSuite, RunsEachCallOnce) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  for (int i = 0; i < 1000; ++i) {
    const std::string text = std::to_string(i);
    const auto reply = binding.call(echo::kEchoOnce, bytes_of(text));
    ASSERT_TRUE(reply) << to_string(reply.error());
    ASSERT_EQ(text_of(*reply), text);
  }
  EXPECT_EQ(server.servant.run_count(), 1000);
}

TEST_P(TransportSuite, ReportsAnUnknownMethod) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  expect_error(binding.call({77, "unknown", 1, false, {}}, {}), CallError::kNoSuchMethod);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

TEST_P(TransportSuite, ReportsAndCountsAServantThatThrows) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  expect_error(binding.call(echo::kFail, {}), CallError::kServantFailed);
  EXPECT_NE(refusal_text().find("basic_string::at"), std::string_view::npos) << refusal_text();
  EXPECT_TRUE(await([&] { return server.server->counters().servant_failure_count == 1; }));
  EXPECT_TRUE(binding.call(echo::kEcho, {})) << "the server goes on";
  EXPECT_EQ(server.server->counters().servant_failure_count, 1u);
}

TEST_P(TransportSuite, ReportsWhyAServantRefuses) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  for (const auto& [refusal, error] : {std::pair{Refusal::kOverload, CallError::kOverload},
                                       {Refusal::kBadRequest, CallError::kBadRequest},
                                       {Refusal::kNotLeaseHolder, CallError::kNotLeaseHolder},
                                       {Refusal::kGone, CallError::kNoSuchObject},
                                       {Refusal::kFailed, CallError::kServantFailed}}) {
    const std::array request{static_cast<std::byte>(refusal)};
    expect_error(binding.call(echo::kRefuse, request), error);
    EXPECT_EQ(refusal_text(), "");
  }
}

TEST_P(TransportSuite, CarriesTheTextOfARefusal) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const auto refuse_with = [&](const std::string& text) {
    const std::string request = static_cast<char>(Refusal::kBadRequest) + text;
    expect_error(binding.call(echo::kRefuse, bytes_of(request)), CallError::kBadRequest);
  };
  refuse_with("force.x is 30, but must be -20 to 20 N");
  EXPECT_EQ(refusal_text(), "force.x is 30, but must be -20 to 20 N");
  EXPECT_EQ(describe(CallError::kBadRequest),
            "the server does not take the request: force.x is 30, but must be -20 to 20 N");
  EXPECT_EQ(describe(CallError::kTimeout), to_string(CallError::kTimeout)) << "is no refusal";
  refuse_with("\033[2J");
  EXPECT_EQ(describe(CallError::kBadRequest).find('\033'), std::string::npos) << "escaped";
  // The text is cut at a character of two bytes.
  refuse_with(std::string(wire::kRefusalTextSizeMax - 1, 'x') + "\u00b5N");
  EXPECT_EQ(refusal_text(), std::string(wire::kRefusalTextSizeMax - 1, 'x'));
  refuse_with("");
  EXPECT_EQ(describe(CallError::kBadRequest), to_string(CallError::kBadRequest));
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

TEST_P(TransportSuite, EndsACallAtItsDeadline) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const MonotonicTime begin = rt::now();
  // The call must enter in time on a busy machine, too: otherwise the server refuses it as late.
  expect_error(binding.call(echo::kHold, bytes_of("late"), {.deadline = 100ms}),
               CallError::kTimeout);
  EXPECT_GE(rt::now() - begin, Duration{100ms});
  server.servant.gate().let_one_go();
  const auto next =
      binding.call(echo::kEcho, bytes_of("next"), {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(next) << to_string(next.error());
  EXPECT_EQ(text_of(*next), "next") << "not the late reply";
  EXPECT_EQ(server.servant.run_count(), 2);
}

TEST_P(TransportSuite, KeepsTheDeadlinesOfMethodsAndNodes) {
  EchoServer server;
  NodeConfig config = node_config();
  Node node(config);
  config.default_deadline = 40ms;
  Node impatient_node(config);
  Binding patient = bind_echo(node, server);
  Binding impatient = bind_echo(impatient_node, server);
  std::thread holder([&] { EXPECT_TRUE(patient.call(echo::kHold, {})); });
  await_inside(server);
  MonotonicTime begin = rt::now();
  expect_late(patient.call(echo::kImpatient, {}));
  EXPECT_GE(rt::now() - begin, echo::kImpatient.default_deadline);
  begin = rt::now();
  expect_late(impatient.call(echo::kEcho, {}));
  EXPECT_GE(rt::now() - begin, Duration{40ms});
  server.servant.gate().let_one_go();
  holder.join();
}

TEST_P(TransportSuite, SkipsACallWhoseDeadlineHasPassed) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  {
    // Two channels with sessions, so that the second call's time passes in the lane's socket.
    const auto first = binding.call(echo::kEcho, {});
    const auto second = binding.call(echo::kEcho, {});
    ASSERT_TRUE(first && second);
  }
  std::thread holder([&] { EXPECT_TRUE(binding.call(echo::kHold, {})); });
  await_inside(server);
  // Over a network that loses frames, a single one may never arrive.
  for (int i = 0; i < 4; ++i)
    expect_late(binding.call(echo::kEchoOnce, {}, {.deadline = 5ms}));
  server.servant.gate().let_one_go();
  holder.join();
  EXPECT_TRUE(await([&] {
    const ServerCounters counters = server.server->counters();
    return counters.late_count >= 1;
  }));
  EXPECT_EQ(server.servant.run_count(), 3) << "the last is the one that held the lane";
}

// hp-5.6-5: a call without a free buffer is refused before it runs, or waits; and by default there
// are many buffers.
TEST_P(TransportSuite, RunsLargeCallsSideBySideOrReportsOverload) {
  // Each takes at most three buffers, including a former reply's: a host's share of the default.
  constexpr int kThreadCount = 8;
  constexpr int kCallCount = 8;
  for (const std::uint32_t room_count : {2U, ServerConfig{}.large_message_count_max}) {
    ServerConfig config = quiet_config();
    config.large_message_count_max = room_count;
    EchoServer server(config);
    Node node(node_config());
    Binding binding = bind_echo(node, server);
    const std::string request(100'000, 'x');
    const std::uint32_t grown = 100'000;
    std::atomic<int> done_count{0};
    std::atomic<int> overload_count{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < kThreadCount; ++i) {
      threads.emplace_back([&, i] {
        for (int call = 0; call < kCallCount; ++call) {
          const auto reply = (i + call) % 2 == 0
                                 ? binding.call(echo::kEcho, bytes_of(request))
                                 : binding.call(echo::kGrow, std::as_bytes(std::span(&grown, 1)));
          if (reply) {
            EXPECT_EQ(reply->bytes().size(), 100'000u);
            done_count.fetch_add(1);
          } else {
            EXPECT_EQ(reply.error(), CallError::kOverload) << to_string(reply.error());
            overload_count.fetch_add(1);
          }
        }
      });
    }
    for (std::thread& thread : threads)
      thread.join();
    EXPECT_EQ(done_count + overload_count, kThreadCount * kCallCount);
    EXPECT_EQ(server.servant.run_count(), done_count) << "refused is not run";
    if (room_count > 2) {
      EXPECT_EQ(overload_count, 0);
    }
  }
}

TEST_P(TransportSuite, ServesManyThreadsOnOneBinding) {
  constexpr int kThreadCount = 8;
  constexpr int kCallCount = 300;
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  std::vector<std::thread> threads;
  for (int number = 0; number < kThreadCount; ++number) {
    threads.emplace_back([&binding, number] {
      for (int i = 0; i < kCallCount; ++i) {
        const std::string text = std::to_string(number) + " " + std::to_string(i);
        const auto reply = binding.call(echo::kEchoOnce, bytes_of(text));
        ASSERT_TRUE(reply) << to_string(reply.error());
        ASSERT_EQ(text_of(*reply), text);
      }
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(server.servant.run_count(), kThreadCount * kCallCount);
}

TEST_P(TransportSuite, KeepsTheObjectsOfOneServerApart) {
  echo::Servant first;
  echo::Servant second;
  auto server = std::move(*Server::create(quiet_config()));
  ASSERT_TRUE(server->add("first", first));
  ASSERT_TRUE(server->add("second", second));
  ASSERT_TRUE(server->start());
  Node node(node_config());
  auto to_first = Binding::bind(node, server->url("first"), echo::kInterface);
  auto to_second = Binding::bind(node, server->url("second"), echo::kInterface);
  auto again = Binding::bind(node, server->url("second"), echo::kInterface);
  ASSERT_TRUE(to_first && to_second && again);
  EXPECT_TRUE(to_first->call(echo::kEcho, {}));
  EXPECT_TRUE(to_second->call(echo::kEcho, {}));
  EXPECT_TRUE(again->call(echo::kEcho, {}));
  EXPECT_EQ(first.run_count(), 1);
  EXPECT_EQ(second.run_count(), 2);
  server->stop();
}

TEST_P(TransportSuite, KeepsAReplyAsLongAsItsLease) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const auto first = binding.call(echo::kEcho, bytes_of("first"));
  ASSERT_TRUE(first);
  const auto second = binding.call(echo::kEcho, bytes_of("second"));
  ASSERT_TRUE(second);
  EXPECT_EQ(text_of(*first), "first");
  EXPECT_EQ(text_of(*second), "second");
}

TEST_P(TransportSuite, KeepsTheLimitOfChannels) {
  EchoServer server;
  NodeConfig config = node_config();
  config.channel_count_max = 2;
  Node node(config);
  Binding binding = bind_echo(node, server);
  {
    const auto first = binding.call(echo::kEcho, {});
    const auto second = binding.call(echo::kEcho, {});
    ASSERT_TRUE(first && second);
    expect_error(binding.call(echo::kEcho, {}), CallError::kNoChannel);
  }
  EXPECT_TRUE(binding.call(echo::kEcho, {})) << "the leases gave theirs back";
  EXPECT_EQ(server.servant.run_count(), 3);
}

TEST_P(TransportSuite, PassesCallerAndDeadlineToTheServant) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const MonotonicTime before = rt::now();
  const echo::Place place = place_of(binding, {.deadline = 10s, .trace_id = 0x7ace});
  const MonotonicTime after = rt::now();
  EXPECT_EQ(place.trace_id, 0x7aceu);
  EXPECT_NE(place.session, 0u);
  EXPECT_EQ(place_of(binding).session, place.session) << "the same caller";
  EXPECT_GE(place.received_ns, to_ns(before));
  EXPECT_LE(place.received_ns, to_ns(after));
  // Both read one clock: the deadline is the caller's, up to the rounding of its budget.
  EXPECT_GE(place.deadline_ns, to_ns(before + 10s));
  EXPECT_LE(place.deadline_ns, to_ns(after + 10s + 1us));
}

TEST_P(TransportSuite, WaitsByEveryStrategy) {
  for (const rt::WaitStrategy lane_wait :
       {rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kBlock, rt::WaitStrategy::kSpin}) {
    LaneConfig lane;
    lane.wait.strategy = lane_wait;
    EchoServer server(quiet_config({lane}));
    for (const rt::WaitStrategy wait :
         {rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kBlock, rt::WaitStrategy::kSpin}) {
      NodeConfig config = node_config();
      config.wait.strategy = wait;
      Node node(config);
      Binding binding = bind_echo(node, server);
      for (int i = 0; i < 20; ++i)
        ASSERT_TRUE(binding.call(echo::kEcho, {}));
    }
  }
}

/// A servant that records its callers' addresses.
class CallerNotingServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    caller = context.caller;
    return {};
  }
  CallerHost caller{};
};

// Registries and others that serve strangers have quotas per host.
TEST_P(TransportSuite, PassesTheCallersHostToTheServant) {
  CallerNotingServant servant;
  auto server = std::move(*Server::create(quiet_config()));
  ASSERT_TRUE(server->add("noting", servant));
  ASSERT_TRUE(server->start());
  Node node(node_config());
  auto binding = Binding::bind(node, server->url("noting"), echo::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  const Bytes large(100'000);
  for (const ConstBytes request : {ConstBytes{}, ConstBytes(large)}) {
    servant.caller = {};
    ASSERT_TRUE(binding->call(echo::kEcho, request));
    EXPECT_EQ(servant.caller, kThisHost) << to_string(servant.caller);
    EXPECT_TRUE(servant.caller.is_this_host());
  }
  EXPECT_EQ(to_string(CallerHost{0x0a01'02ff}), "10.1.2.255");
  server->stop();
}

}  // namespace rtpm::rpc::test
