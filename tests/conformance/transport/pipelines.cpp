#include <algorithm>
#include <deque>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/rpc/pipeline.hpp"
#include "rtpm/rt/clock.hpp"
#include "suite.hpp"

// Calls that are in flight together.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

std::string numbered(std::size_t number, std::size_t size = 20) {
  std::string text = "call " + std::to_string(number) + " ";
  text.resize(std::max(size, text.size()), static_cast<char>('a' + number % 26));
  return text;
}

/// Begins the call, which must not fail yet.
PendingReply begin(Binding& binding, Pipeline& pipeline, std::string_view text,
                   const MethodDescriptor& method = echo::kEcho, CallOptions options = {}) {
  options.pipeline = &pipeline;
  auto begun = binding.begin(method, bytes_of(text), options);
  EXPECT_TRUE(begun) << to_string(begun.error());
  return begun ? std::move(*begun) : PendingReply{};
}

/// Begins this many calls, each with its number.
std::vector<PendingReply> begin_numbered(Binding& binding, Pipeline& pipeline, std::size_t count) {
  std::vector<PendingReply> calls;
  for (std::size_t i = 0; i < count; ++i)
    calls.push_back(begin(binding, pipeline, numbered(i)));
  return calls;
}

/// The call's reply is its number.
void expect_numbered(PendingReply& call, std::size_t number) {
  const auto reply = call.take();
  ASSERT_TRUE(reply) << number << ": " << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), numbered(number));
}
void expect_numbered(std::vector<PendingReply>& calls) {
  for (std::size_t i = 0; i < calls.size(); ++i)
    expect_numbered(calls[i], i);
}

/// Opens the sessions that this many calls take, which no lane gives while its only thread runs a
/// call.
void open_sessions(Binding& binding, Pipeline& pipeline, std::size_t count) {
  std::vector<PendingReply> calls = begin_numbered(binding, pipeline, count);
  expect_numbered(calls);
}

}  // namespace

TEST_P(TransportSuite, GivesEachCallOfAPipelineItsReply) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  constexpr std::size_t kInFlight = 64;
  constexpr std::size_t kCount = 500;
  std::deque<PendingReply> calls;
  std::size_t taken = 0;
  for (std::size_t begun = 0; taken < kCount; ++taken) {
    for (; begun < std::min(kCount, taken + kInFlight); ++begun)
      calls.push_back(begin(binding, pipeline, numbered(begun)));
    const auto reply = calls.front().take();
    ASSERT_TRUE(reply) << to_string(reply.error());
    EXPECT_EQ(text_of(*reply), numbered(taken));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reply->bytes().data()) % 16, 0u);
    calls.pop_front();
  }
  EXPECT_EQ(pipeline.open_count(), 0u);
  EXPECT_EQ(server.servant.run_count(), static_cast<int>(kCount)) << "each ran once";
}

TEST_P(TransportSuite, GivesTheRepliesOfAPipelineInAnyOrder) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  std::vector<PendingReply> calls = begin_numbered(binding, pipeline, 30);
  for (std::size_t i = calls.size(); i-- > 0;)
    expect_numbered(calls[i], i);
}

// Some are larger than a frame, or than all that is sent together; small ones are between them.
TEST_P(TransportSuite, CarriesMessagesOfAllSizesInAPipeline) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  const std::vector<std::size_t> sizes{
      10, frame_payload_max(), 11, frame_payload_max() + 1, 100, 5000, 13, 70'000, 17, 17, 300'000,
      14};
  std::vector<PendingReply> calls;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    calls.push_back(
        begin(binding, pipeline, numbered(i, sizes[i]), echo::kEcho, {.deadline = 30s}));
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const auto reply = calls[i].take();
    ASSERT_TRUE(reply) << sizes[i] << " bytes: " << to_string(reply.error());
    EXPECT_TRUE(text_of(*reply) == numbered(i, sizes[i])) << sizes[i] << " bytes";
  }
}

TEST_P(TransportSuite, KeepsARepliesBytesWhileThePipelineGoesOn) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  const auto held = begin(binding, pipeline, "held").take();
  ASSERT_TRUE(held);
  EXPECT_EQ(pipeline.open_count(), 1u);
  for (std::size_t i = 0; i < 40; ++i) {
    auto first = begin(binding, pipeline, numbered(i));
    auto second = begin(binding, pipeline, numbered(i + 1));
    ASSERT_TRUE(first.take());
    ASSERT_TRUE(second.take());
  }
  EXPECT_EQ(text_of(*held), "held");
}

TEST_P(LosslessSuite, SendsWhatAPipelineHoldsWithAFlush) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  auto call = begin(binding, pipeline, "flushed");
  pipeline.flush();
  EXPECT_TRUE(await([&] { return server.servant.run_count() == 1; }));
  EXPECT_TRUE(await([&] { return call.is_done(); }));
  const auto reply = call.take();
  ASSERT_TRUE(reply);
  EXPECT_EQ(text_of(*reply), "flushed");
}

// A caller that only polls, or that waits for another call, still sends it.
TEST_P(LosslessSuite, SendsWhatAPipelineHoldsWhenItIsAskedFor) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  open_sessions(binding, pipeline, 2);
  auto looked_at = begin(binding, pipeline, "looked at");
  EXPECT_TRUE(await([&] { return looked_at.is_done(); }));
  auto hold = begin(binding, pipeline, "hold", echo::kHold);
  pipeline.flush();
  await_inside(server);
  auto behind = begin(binding, pipeline, "behind");
  EXPECT_FALSE(hold.wait(rt::now() + 50ms));
  server.servant.gate().open();
  EXPECT_TRUE(await([&] { return server.servant.run_count() == 5; })) << "nobody asked for it";
  EXPECT_TRUE(behind.take());
}

// The calls arrive together, but the answer to the first must not wait for the second.
TEST_P(LosslessSuite, AnswersACallOfAPipelineBeforeOneThatTakesLong) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  open_sessions(binding, pipeline, 40);
  auto first = begin(binding, pipeline, "first");
  auto hold = begin(binding, pipeline, "hold", echo::kHold);
  pipeline.flush();
  await_inside(server);
  const auto reply = first.take();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), "first");
  server.servant.gate().open();
  EXPECT_TRUE(hold.take());
}

TEST_P(TransportSuite, EndsOneCallOfAPipelineAtItsDeadline) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  open_sessions(binding, pipeline, 6);
  auto late = begin(binding, pipeline, "late", echo::kHold, {.deadline = 100ms});
  std::vector<PendingReply> others = begin_numbered(binding, pipeline, 5);
  expect_error(late.take(), CallError::kTimeout);
  server.servant.gate().open();
  expect_numbered(others);
}

TEST_P(LosslessSuite, CancelsOneCallOfAPipeline) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  open_sessions(binding, pipeline, 2);
  auto hold = begin(binding, pipeline, "hold", echo::kHold);
  auto other = begin(binding, pipeline, "other");
  pipeline.flush();
  await_inside(server);
  hold.cancel();
  expect_error(hold.take(), CallError::kCancelled);
  server.servant.gate().open();
  const auto reply = other.take();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), "other");
  // This call is dropped before it is sent.
  { auto dropped = begin(binding, pipeline, "dropped"); }
  EXPECT_TRUE(begin(binding, pipeline, "last").take());
  EXPECT_EQ(pipeline.open_count(), 1u) << "the reply is still held";
}

TEST_P(TransportSuite, TellsOneCallOfAPipelineThatItFailed) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  const std::string too_large(message_size_max() + 1, 'x');
  auto first = begin(binding, pipeline, "first");
  auto fails = begin(binding, pipeline, "", echo::kFail);
  const auto refused = binding.begin(echo::kEcho, bytes_of(too_large), {.pipeline = &pipeline});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), CallError::kTooLarge);
  auto last = begin(binding, pipeline, "last");
  EXPECT_TRUE(first.take());
  expect_error(fails.take(), CallError::kServantFailed);
  EXPECT_NE(refusal_text(), "");
  EXPECT_TRUE(last.take());
  EXPECT_EQ(pipeline.open_count(), 0u);
}

TEST_P(TransportSuite, LimitsAPipelineToItsChannels) {
  EchoServer server;
  NodeConfig config = node_config();
  config.channel_count_max = 2;
  Node node(config);
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  std::vector<PendingReply> calls;
  std::optional<CallError> error;
  while (!error && calls.size() < 100) {
    auto call = binding.begin(echo::kEcho, bytes_of("x"), {.pipeline = &pipeline});
    if (call) calls.push_back(std::move(*call));
    if (!call) error = call.error();
  }
  EXPECT_EQ(error, CallError::kNoChannel);
  // The bind and single calls use the other channel.
  EXPECT_EQ(calls.size(), is_udp() ? std::size_t{wire::kCallWindow} : std::size_t{2});
  EXPECT_TRUE(calls.front().take());
  EXPECT_TRUE(begin(binding, pipeline, "one more").take()) << "a place is free again";
  for (std::size_t i = 1; i < calls.size(); ++i)
    EXPECT_TRUE(calls[i].take());
}

TEST_P(TransportSuite, SharesAPipelineAmongBindingsAndPriorities) {
  LaneConfig high = quiet_lane(20'000);
  EchoServer server(quiet_config({quiet_lane(), high}));
  EchoServer another;
  Node node(node_config());
  Binding first = bind_echo(node, server);
  Binding second = bind_echo(node, server);
  Binding elsewhere = bind_echo(node, another);
  Pipeline pipeline;
  std::vector<PendingReply> calls;
  for (std::size_t i = 0; i < 24; ++i) {
    Binding& binding = i % 3 == 0 ? first : i % 3 == 1 ? second : elsewhere;
    const CallOptions options{.priority = i % 2 == 0 ? Priority{100} : Priority{25'000}};
    calls.push_back(begin(binding, pipeline, numbered(i), echo::kEcho, options));
  }
  expect_numbered(calls);
  EXPECT_EQ(server.servant.run_count(), 16);
  EXPECT_EQ(another.servant.run_count(), 8);
}

TEST_P(LosslessSuite, TellsAllCallsOfAPipelineThatTheServerStopped) {
  EchoServer server;
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  Pipeline pipeline;
  open_sessions(binding, pipeline, 13);
  std::vector<PendingReply> calls;
  calls.push_back(begin(binding, pipeline, "hold", echo::kHold));
  for (std::size_t i = 0; i < 12; ++i)
    calls.push_back(begin(binding, pipeline, numbered(i), echo::kEchoOnce));
  pipeline.flush();
  await_inside(server);
  std::thread stopper([&] { server.server->stop(); });
  // stop() waits for the call that runs.
  std::this_thread::sleep_for(20ms);
  server.servant.gate().open();
  stopper.join();
  for (PendingReply& call : calls) {
    const auto reply = call.take();
    if (reply) continue;
    EXPECT_TRUE(reply.error() == CallError::kStopped || reply.error() == CallError::kDisconnected ||
                reply.error() == CallError::kPeerRestarted)
        << to_string(reply.error());
  }
  EXPECT_EQ(pipeline.open_count(), 0u);
}

TEST_P(LosslessSuite, GoesOnInAPipelineWithARestartedServer) {
  ServerConfig config = quiet_config();
  std::optional<EchoServer> server;
  server.emplace(config);
  config.port = server->server->port();
  Node node(node_config());
  Binding binding = bind_echo(node, *server);
  Pipeline pipeline;
  for (int restart = 0; restart < 3; ++restart) {
    SCOPED_TRACE("restart " + std::to_string(restart));
    std::vector<PendingReply> calls = begin_numbered(binding, pipeline, 12);
    expect_numbered(calls);
    server.reset();
    server.emplace(config);
  }
}

}  // namespace rtpm::rpc::test
