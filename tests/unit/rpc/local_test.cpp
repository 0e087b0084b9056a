#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <thread>

#include "deferring_servant.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// Calls to a server in the same program. TransportSuite covers the guarantees of every call.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

TEST(LocalCalls, UseNoTransportByDefault) {
  EchoServer server;
  Node node(quiet_node(Transport::kAuto));
  Binding binding = bind_echo(node, server);
  EXPECT_EQ(binding.transport(), Transport::kLocal);
  const auto frames = [&] { return server.server->counters().frames.received_count; };
  const auto calls = [&] { return server.server->counters().call_count; };
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  // A lane updates its counters a moment after its reply.
  EXPECT_TRUE(await([&] { return calls() == 1; }));
  const auto frames_before = frames();
  for (int i = 0; i < 100; ++i)
    EXPECT_TRUE(binding.call(echo::kEcho, {}));
  EXPECT_TRUE(await([&] { return calls() == 101; }));
  EXPECT_EQ(frames(), frames_before);

  EXPECT_EQ(bind_echo(node, server, {.transport = Transport::kUdp}).transport(), Transport::kUdp);
  NodeConfig apart = quiet_node(Transport::kAuto);
  apart.collocates = false;
  Node other(apart);
  EXPECT_EQ(bind_echo(other, server).transport(),
            transport::offers_shared_memory() ? Transport::kSharedMemory : Transport::kUdp);
}

TEST(LocalCalls, RunInTheLaneOfTheirPriority) {
  EchoServer server(quiet_config({quiet_lane(0), quiet_lane(20'000)}));
  Node node(quiet_node(Transport::kAuto));
  Binding binding = bind_echo(node, server);
  const echo::Place low = place_of(binding, {.priority = 100});
  const echo::Place high = place_of(binding, {.priority = 25'000, .trace_id = 9});
  EXPECT_STREQ(low.thread_name.data(), "lane-0");
  EXPECT_STREQ(high.thread_name.data(), "lane-20000");
  EXPECT_EQ(high.priority, 25'000);
  EXPECT_EQ(high.trace_id, 9);
  EXPECT_NE(high.thread, gettid());
  EXPECT_EQ(high.session, low.session) << "the same caller";
  Binding other = bind_echo(node, server);
  EXPECT_NE(place_of(other).session, low.session) << "another";
}

TEST(LocalCalls, ContinueWithTheNextServerAtTheAddress) {
  ServerConfig config = quiet_config();
  auto first = std::make_unique<EchoServer>(config);
  config.port = first->server->port();
  Node node(quiet_node(Transport::kAuto));
  Binding binding = bind_echo(node, *first);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  first.reset();
  EXPECT_FALSE(binding.call(echo::kEcho, {}, {.deadline = 50ms}));
  EchoServer second(config);
  EXPECT_TRUE(await([&] { return binding.call(echo::kEcho, {}).has_value(); }));
}

// A thread that runs a method can't wait for itself.
TEST(LocalCalls, OfAMethodToItsOwnLaneRunOnItsThread) {
  for (const std::uint32_t buffered : {0U, 4U}) {
    /// Calls another object of the same server.
    class Outer final : public Servant {
     public:
      const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
      DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes reply,
                              const CallContext&) override {
        const auto inner = binding->call(echo::kWhere, {}, {.priority = inner_priority});
        if (!inner) return {wire::Status::kServantFailed, 0};
        std::memcpy(reply.data(), inner->bytes().data(), inner->bytes().size());
        thread = gettid();
        priority_after = rt::current_priority()->value();
        return {wire::Status::kOk, static_cast<std::uint32_t>(inner->bytes().size())};
      }
      Binding* binding = nullptr;
      Priority inner_priority = 300;
      std::atomic<pid_t> thread{0};
      std::atomic<int> priority_after{0};
    };
    LaneConfig low = quiet_lane(0);
    LaneConfig high = quiet_lane(20'000);
    low.buffered_request_max = high.buffered_request_max = buffered;
    Outer outer;
    echo::Servant inner;
    auto server = std::move(*Server::create(quiet_config({low, high})));
    ASSERT_TRUE(server->add("outer", outer));
    ASSERT_TRUE(server->add("inner", inner));
    ASSERT_TRUE(server->start());
    Node node(quiet_node(Transport::kAuto));
    auto to_inner = Binding::bind(node, server->url("inner"), echo::kInterface);
    auto to_outer = Binding::bind(node, server->url("outer"), echo::kInterface);
    ASSERT_TRUE(to_inner && to_outer);
    outer.binding = &*to_inner;
    const echo::Place own = place_of(*to_outer, {.priority = 200});
    EXPECT_EQ(own.thread, outer.thread.load());
    EXPECT_EQ(own.priority, 300);
    EXPECT_EQ(outer.priority_after.load(), 200) << "as it was before";
    outer.inner_priority = 25'000;
    const echo::Place others = place_of(*to_outer, {.priority = 200});
    EXPECT_NE(others.thread, outer.thread.load());
    EXPECT_EQ(others.priority, 25'000);
    server->stop();
  }
}

class LocalDeferredReplies : public testing::TestWithParam<std::uint32_t> {
 protected:
  void SetUp() override {
    LaneConfig lane = quiet_lane();
    lane.buffered_request_max = GetParam();
    server_ = rtpm::test::serve("late", servant_, quiet_config({lane}));
    auto bound = Binding::bind(node_, server_->url("late"), echo::kInterface);
    ASSERT_TRUE(bound);
    binding_.emplace(std::move(*bound));
  }
  DeferringServant servant_;
  std::unique_ptr<Server> server_;
  Node node_{quiet_node(Transport::kAuto)};
  std::optional<Binding> binding_;
};

TEST_P(LocalDeferredReplies, ComeFromAnyThread) {
  std::thread caller([&] {
    const auto reply = binding_->call(echo::kEchoOnce, bytes_of("question"));
    ASSERT_TRUE(reply) << to_string(reply.error());
    EXPECT_EQ(text_of(*reply), "answer");
  });
  DeferredReply reply = servant_.reply();
  std::memcpy(reply.buffer().data(), "answer", 6);
  reply.complete(wire::Status::kOk, 6);
  caller.join();
  server_->stop();
}

TEST_P(LocalDeferredReplies, EndWithTheServer) {
  std::thread caller([&] {
    const auto reply = binding_->call(echo::kEchoOnce, {});
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error(), CallError::kStopped);
  });
  DeferredReply reply = servant_.reply();
  server_->stop();
  caller.join();
  EXPECT_FALSE(reply.is_awaited());
  reply.complete(wire::Status::kOk);
}

TEST_P(LocalDeferredReplies, EndAtTheCallersDeadline) {
  const auto reply = binding_->call(echo::kEchoOnce, {}, {.deadline = 100ms});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kTimeout);
  DeferredReply late = servant_.reply();
  late.complete(wire::Status::kOk);
  std::thread caller([&] { EXPECT_TRUE(binding_->call(echo::kEchoOnce, {})); });
  servant_.reply().complete(wire::Status::kOk);
  caller.join();
  server_->stop();
}

INSTANTIATE_TEST_SUITE_P(OneThreadAndSeveral, LocalDeferredReplies, testing::Values(0, 4));

// A node may be destroyed while a lane still has one of its calls.
TEST(LocalCalls, MayOutliveTheirNode) {
  EchoServer server;
  {
    Node node(quiet_node(Transport::kAuto));
    Binding binding = bind_echo(node, server);
    const auto reply = binding.call(echo::kHold, bytes_of("kept"), {.deadline = 100ms});
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error(), CallError::kTimeout);
    ASSERT_EQ(server.servant.gate().inside_count(), 1);
  }
  server.servant.gate().open();
  Node node(quiet_node(Transport::kAuto));
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

}  // namespace
}  // namespace rtpm::rpc
