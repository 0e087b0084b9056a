#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "noting_servant.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// Lanes of several threads: concurrent calls, queued calls, and refused calls.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

LaneConfig lane_of(std::uint32_t threads, std::uint32_t buffered = 0, Priority low = 0) {
  LaneConfig lane = quiet_lane(low);
  lane.static_threads = threads;
  lane.buffered_request_max = buffered;
  return lane;
}

/// Calls that are inside `hold`, each from its own thread.
class Holders {
 public:
  Holders(EchoServer& server, Binding& binding) : server_(server), binding_(binding) {}
  ~Holders() { end(); }
  Holders(const Holders&) = delete;
  Holders& operator=(const Holders&) = delete;

  void add(const CallOptions& options = {}) {
    threads_.emplace_back([this, options] {
      if (binding_.call(echo::kHold, {}, options)) ++done_count_;
    });
  }
  void add_inside(int count, const CallOptions& options = {}) {
    const int inside_count = server_.servant.gate().inside_count() + count;
    for (int i = 0; i < count; ++i)
      add(options);
    EXPECT_TRUE(await([&] { return server_.servant.gate().inside_count() == inside_count; }));
  }
  void end() {
    server_.servant.gate().open();
    for (std::thread& thread : threads_)
      thread.join();
    threads_.clear();
  }
  [[nodiscard]] int done_count() const { return done_count_.load(); }

 private:
  EchoServer& server_;
  Binding& binding_;
  std::vector<std::thread> threads_;
  std::atomic<int> done_count_{0};
};

CallError error_of_call(Binding& binding, const CallOptions& options = {}) {
  const auto reply = binding.call(echo::kEchoOnce, {}, options);
  return reply ? CallError{} : reply.error();
}

TEST(ThreadPool, RunsOneCallPerThread) {
  EchoServer server(quiet_config({lane_of(3)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  Holders holders(server, binding);
  holders.add_inside(2);
  EXPECT_TRUE(binding.call(echo::kEcho, {})) << "the third thread is free";
  holders.add_inside(1);
  EXPECT_EQ(error_of_call(binding), CallError::kOverload) << "all are busy, and none may wait";
  EXPECT_TRUE(await([&] { return server.server->counters().overload_count == 1; }));
  holders.end();
  EXPECT_EQ(holders.done_count(), 3);
  EXPECT_TRUE(binding.call(echo::kEcho, {})) << "it recovers";
}

TEST(ThreadPool, QueuesCallsUpToItsLimit) {
  EchoServer server(quiet_config({lane_of(1, 2)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  Holders holders(server, binding);
  holders.add_inside(1);
  holders.add();
  holders.add();
  ASSERT_TRUE(await([&] { return server.server->counters().queued_count_max == 2; }));
  EXPECT_EQ(error_of_call(binding), CallError::kOverload);
  holders.end();
  EXPECT_EQ(holders.done_count(), 3);
}

TEST(ThreadPool, QueuesBytesUpToItsLimit) {
  LaneConfig lane = lane_of(1, 10);
  lane.buffered_byte_max = 1000;
  EchoServer server(quiet_config({lane}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  Holders holders(server, binding);
  holders.add_inside(1);
  const Bytes large(1001);
  const auto reply = binding.call(echo::kEchoOnce, large);
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kOverload);
  holders.end();
  EXPECT_TRUE(binding.call(echo::kEchoOnce, large))
      << "a call that need not wait has no such limit";
}

// A single lane for all priorities must not serve them in the order of arrival.
TEST(ThreadPool, RunsTheMostUrgentFirst) {
  NotingServant servant;
  const auto server = rtpm::test::serve("echo", servant, quiet_config({lane_of(1, 16)}));
  Node node(quiet_node());
  auto binding = Binding::bind(node, server->url("echo"), echo::kInterface);
  ASSERT_TRUE(binding);
  std::vector<std::thread> threads;
  threads.emplace_back([&] { EXPECT_TRUE(binding->call(echo::kHold, {})); });
  ASSERT_TRUE(await([&] { return servant.gate.inside_count() == 1; }));
  std::uint64_t waiting_count = 0;
  for (const std::uint16_t priority :
       std::to_array<std::uint16_t>({100, 30'000, 200, 20'000, 200})) {
    threads.emplace_back(
        [&, priority] { EXPECT_TRUE(binding->call(echo::kEcho, {}, {.priority = priority})); });
    ++waiting_count;
    ASSERT_TRUE(await([&] { return server->counters().queued_count_max == waiting_count; }));
  }
  servant.gate.open();
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(servant.order(), (std::vector<int>{30'000, 20'000, 200, 200, 100}));
  server->stop();
}

TEST(ThreadPool, DropsCallsThatWaitedTooLong) {
  EchoServer server(quiet_config({lane_of(1, 4)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  Holders holders(server, binding);
  holders.add_inside(1);
  // The call must be queued in time on a busy machine, too: otherwise it expires before that.
  EXPECT_EQ(error_of_call(binding, {.deadline = 100ms}), CallError::kTimeout);
  holders.end();
  EXPECT_TRUE(await([&] { return server.server->counters().late_count == 1; }));
  EXPECT_EQ(server.servant.run_count(), 1) << "only the one that held the lane";
}

TEST(ThreadPool, StartsAndEndsDynamicThreads) {
  LaneConfig lane = lane_of(1);
  lane.name = "grows";
  lane.dynamic_threads = 2;
  lane.dynamic_idle = 20ms;
  EchoServer server(quiet_config({lane}));
  const auto thread_count = [] { return rtpm::test::threads_named("grows").size(); };
  EXPECT_EQ(thread_count(), 2) << "one receives, one runs";
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  Holders holders(server, binding);
  holders.add_inside(3);
  EXPECT_EQ(thread_count(), 4);
  EXPECT_EQ(error_of_call(binding), CallError::kOverload);
  holders.end();
  EXPECT_TRUE(await([&] { return thread_count() == 2; })) << "they are idle";
  Holders again(server, binding);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

TEST(ThreadPool, BorrowsAThreadOfALowerLane) {
  ServerConfig config = quiet_config({lane_of(1, 0, 0), lane_of(1, 0, 20'000)});
  config.borrows = true;
  EchoServer server(std::move(config));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server, {.warm_up = {100, 30'000}});
  Holders holders(server, binding);
  holders.add_inside(1, {.priority = 30'000});
  const auto reply = binding.call(echo::kWhere, {}, {.priority = 31'000});
  ASSERT_TRUE(reply) << to_string(reply.error());
  echo::Place place{};
  std::memcpy(&place, reply->bytes().data(), sizeof place);
  EXPECT_EQ(place.priority, 31'000);
  EXPECT_EQ(std::string_view(place.thread_name.data()).substr(0, 6), "lane-0");
  EXPECT_TRUE(await([&] { return server.server->counters().borrowed_count == 1; }));
  const auto low = binding.call(echo::kWhere, {}, {.priority = 100});
  ASSERT_TRUE(low) << "it has come back";
  holders.add_inside(1, {.priority = 30'000});
  EXPECT_EQ(error_of_call(binding, {.priority = 30'000}), CallError::kOverload);
  EXPECT_EQ(error_of_call(binding, {.priority = 100}), CallError::kOverload)
      << "its only thread is lent";
  holders.end();
  EXPECT_TRUE(await([&] { return binding.call(echo::kEcho, {}, {.priority = 100}).has_value(); }));
}

TEST(ThreadPool, LendsNoThreadToALowerLane) {
  ServerConfig config = quiet_config({lane_of(1, 0, 0), lane_of(1, 0, 20'000)});
  config.borrows = true;
  EchoServer server(std::move(config));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server, {.warm_up = {100, 30'000}});
  Holders holders(server, binding);
  holders.add_inside(1, {.priority = 100});
  EXPECT_EQ(error_of_call(binding, {.priority = 100}), CallError::kOverload);
  EXPECT_TRUE(binding.call(echo::kEcho, {}, {.priority = 30'000}));
}

/// Keeps the lowest lane's receiving thread busy, which holds the lane's lock meanwhile.
class BusyLeader {
 public:
  static Priority transform(Priority priority, std::string_view) {
    if (priority == kBusy) {
      is_inside_ = true;
      static_cast<void>(await([] { return !is_wanted_.load(); }));
      is_inside_ = false;
    }
    return priority;
  }
  BusyLeader() { is_wanted_ = true; }
  ~BusyLeader() { end(); }
  static void end() { is_wanted_ = false; }
  static bool is_inside() { return is_inside_; }
  static constexpr Priority kBusy{77};

 private:
  static inline std::atomic<bool> is_wanted_{false};
  static inline std::atomic<bool> is_inside_{false};
};

/// Lanes of one thread each that lend it upwards, with a queue for one more call.
class Borrowing : public testing::Test {
 protected:
  void open(const std::vector<std::uint16_t>& lows) {
    ServerConfig config = quiet_config({});
    BindOptions options{.deadline = rtpm::test::kPatience};
    for (const std::uint16_t low : lows) {
      config.lanes.push_back(lane_of(1, 1, low));
      options.warm_up.push_back(low);
    }
    config.borrows = true;
    config.inbound_priority = BusyLeader::transform;
    server_ = rtpm::test::serve("echo", servant_, std::move(config));
    auto bound = Binding::bind(node_, server_->url("echo"), echo::kInterface, options);
    ASSERT_TRUE(bound) << bound.error().text();
    binding_.emplace(std::move(*bound));
  }
  void TearDown() override {
    servant_.gate.open();
    BusyLeader::end();
    for (std::thread& thread : threads_)
      thread.join();
    server_->stop();
  }
  void call(const MethodDescriptor& method, Priority priority) {
    threads_.emplace_back([this, method, priority] {
      EXPECT_TRUE(binding_->call(method, {}, {.priority = priority}));
    });
  }
  /// Begins a call; returns when its lane has it.
  void begin(const MethodDescriptor& method, Priority priority) {
    const std::uint64_t before = server_->counters().call_count;
    call(method, priority);
    ASSERT_TRUE(await([&] { return server_->counters().call_count > before; }));
  }
  void hold(Priority priority) {
    const int before = servant_.gate.inside_count();
    begin(echo::kHold, priority);
    ASSERT_TRUE(await([&] { return servant_.gate.inside_count() > before; }));
  }

  NotingServant servant_;
  std::unique_ptr<Server> server_;
  /// Over TCP nothing is repeated; over UDP a repetition would hide that a lane forgot a call.
  Node node_{quiet_node(Transport::kTcp)};
  std::optional<Binding> binding_;
  std::vector<std::thread> threads_;
};

// A lane that was refused a thread keeps its request when another one asks.
TEST_F(Borrowing, LendsTheNextFreeThreadToTheMostUrgentLane) {
  open({0, 10'000, 20'000});
  for (const Priority priority : {Priority{100}, Priority{10'000}, Priority{20'000}})
    hold(priority);
  begin(echo::kEcho, Priority{20'001});
  begin(echo::kEcho, Priority{10'001});
  EXPECT_TRUE(servant_.order().empty());
  servant_.gate.let_one_go();
  ASSERT_TRUE(await([&] { return servant_.order().size() == 2; })) << "the lowest lane's thread";
  EXPECT_EQ(servant_.order(), (std::vector<int>{20'001, 10'001}));
  EXPECT_TRUE(await([&] { return server_->counters().borrowed_count == 2; }));
}

// For example, a large reply in a low lane must not delay a higher lane that needs a thread.
TEST_F(Borrowing, NeverWaitsForTheLowerLanesLeader) {
  open({0, 20'000});
  BusyLeader leader;
  hold(Priority{20'000});
  call(echo::kEcho, BusyLeader::kBusy);
  ASSERT_TRUE(await([&] { return BusyLeader::is_inside(); }));
  begin(echo::kEcho, Priority{20'001});
  EXPECT_EQ(error_of_call(*binding_, {.priority = Priority{20'000}}), CallError::kOverload)
      << "the lane goes on receiving";
  EXPECT_TRUE(BusyLeader::is_inside());
  EXPECT_TRUE(servant_.order().empty());
  leader.end();
  ASSERT_TRUE(await([&] { return servant_.order().size() == 2; })) << "the low lane's thread came";
}

TEST(ThreadPool, EndsQueuedCallsAtOnceWhenItStops) {
  auto server = std::make_unique<EchoServer>(quiet_config({lane_of(1, 4)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, *server);
  std::atomic<bool> has_run{false};
  std::thread running([&] { has_run = binding.call(echo::kHold, {}).has_value(); });
  ASSERT_TRUE(await([&] { return server->servant.gate().inside_count() == 1; }));
  CallError error{};
  std::thread waiting([&] { error = error_of_call(binding); });
  ASSERT_TRUE(await([&] { return server->server->counters().queued_count_max == 1; }));
  std::thread stopping([&] { server->server->stop(); });
  waiting.join();
  EXPECT_EQ(error, CallError::kStopped) << "before the running call has ended";
  server->servant.gate().open();
  running.join();
  EXPECT_TRUE(has_run) << "a running call is finished and answered";
  stopping.join();
}

TEST(ThreadPool, EndsACallThatOverrunsTheStop) {
  auto server = std::make_unique<EchoServer>(quiet_config({lane_of(1, 4)}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, *server);
  CallError error{};
  std::thread running([&] {
    const auto reply = binding.call(echo::kHold, {});
    if (!reply) error = reply.error();
  });
  ASSERT_TRUE(await([&] { return server->servant.gate().inside_count() == 1; }));
  std::thread stopping([&] { server->server->stop(); });
  running.join();
  EXPECT_EQ(error, CallError::kStopped);
  server->servant.gate().open();
  stopping.join();
}

TEST(ThreadPool, ServesManyCallersAtOnceOverEveryTransport) {
  for (const Transport transport : transports_of_host()) {
    ServerConfig config = quiet_config({lane_of(2, 64, 0), lane_of(2, 64, 20'000)});
    config.borrows = true;
    config.lanes.front().dynamic_threads = 2;
    config.lanes.front().dynamic_idle = 1ms;
    EchoServer server(std::move(config));
    Node node(quiet_node(transport));
    Binding binding = bind_echo(node, server);
    std::vector<std::thread> threads;
    for (int number = 0; number < 8; ++number) {
      threads.emplace_back([&binding, number] {
        const auto priority = static_cast<std::uint16_t>(number * 4000);
        for (int i = 0; i < 300; ++i) {
          const std::string text = std::to_string(number) + " " + std::to_string(i);
          const auto reply = binding.call(echo::kEchoOnce, bytes_of(text), {.priority = priority});
          ASSERT_TRUE(reply) << to_string(reply.error());
          ASSERT_EQ(text_of(*reply), text);
        }
      });
    }
    for (std::thread& thread : threads)
      thread.join();
    EXPECT_EQ(server.servant.run_count(), 8 * 300);
  }
}

TEST(ThreadPoolSetUp, RefusesNumbersOutOfRange) {
  const auto error_of = [](auto change) {
    LaneConfig lane = quiet_lane();
    change(lane);
    const auto server = Server::create(quiet_config({lane}));
    return server ? std::string() : server.error().text();
  };
  expect_text(error_of([](LaneConfig& lane) { lane.static_threads = 0; }),
              {"static_threads of the lane from priority 0 is 0", "1 to 64"});
  expect_text(error_of([](LaneConfig& lane) { lane.static_threads = 65; }), {"Remedy"});
  expect_text(error_of([](LaneConfig& lane) { lane.dynamic_threads = 65; }), {"0 to 64"});
  expect_text(error_of([](LaneConfig& lane) { lane.dynamic_idle = -1ns; }), {"negative"});
  expect_text(error_of([](LaneConfig& lane) { lane.buffered_request_max = 4097; }), {"4096"});
}

/// Cancels two calls that wait behind a running one; the second also has a deadline, which passes.
/// Returns how many of the two the servant began.
int begun_of_cancelled(LaneConfig lane) {
  EchoServer server(quiet_config({lane}));
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto begin = [&](const MethodDescriptor& method, Duration deadline) {
    auto call = binding.begin(method, {}, {.deadline = deadline});
    EXPECT_TRUE(call);
    return std::move(*call);
  };
  {
    // A busy lane opens no session.
    std::array<PendingReply, 3> sessions;
    for (PendingReply& session : sessions)
      session = begin(echo::kEcho, 20s);
    for (PendingReply& session : sessions)
      EXPECT_TRUE(session.take());
  }
  const int run_count = server.servant.run_count();
  PendingReply hold = begin(echo::kHold, 60s);
  EXPECT_TRUE(await([&] { return server.servant.gate().inside_count() == 1; }));
  PendingReply waiting = begin(echo::kEchoOnce, 60s);
  const MonotonicTime end = rt::now() + 20ms;
  PendingReply impatient = begin(echo::kEchoOnce, 20ms);
  waiting.cancel();
  EXPECT_EQ(waiting.take().error(), CallError::kCancelled) << "whatever the server does";
  impatient.cancel();
  EXPECT_TRUE(await([&] { return rt::now() > end; }));
  server.servant.gate().open();
  EXPECT_TRUE(hold.take());
  EXPECT_TRUE(binding.call(echo::kEcho, {})) << "behind all that waited";
  return server.servant.run_count() - run_count - 2;
}

// hp-5.9-2
TEST(Cancellation, RemovesAQueuedCallFromALaneThatReceives) {
  EXPECT_EQ(begun_of_cancelled(lane_of(1, 4)), 0);
}

// The lane reads CANCEL after the call itself: only the deadline stops the other call.
TEST(Cancellation, ArrivesTooLateAtALaneThatReceivesNothing) {
  EXPECT_EQ(begun_of_cancelled(lane_of(1)), 1);
}

}  // namespace
}  // namespace rtpm::rpc
