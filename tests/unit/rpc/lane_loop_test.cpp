#include <gtest/gtest.h>

#include "scripted_lane.hpp"

// A lane's duty cycle, iteration by iteration, in virtual time.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

// The time that one reading of the clock takes.
constexpr Duration kClockCost = 100ns;

// One source has endless frames, and 63 sources have one frame each.
TEST(LaneLoop, ServesEachSourceBesideABusyOne) {
  for (const rt::WaitStrategy strategy : {rt::WaitStrategy::kSpin, rt::WaitStrategy::kBlock}) {
    VirtualTime::start(kClockCost);
    ScriptedLane scripted(strategy);
    ScriptedConnection& hot = scripted.connect();
    std::vector<ScriptedConnection*> others;
    for (int i = 0; i < 63; ++i)
      others.push_back(&scripted.connect());
    ScriptedClient hot_client(hot);
    hot.is_endless = true;
    std::vector<std::unique_ptr<ScriptedClient>> clients;
    for (ScriptedConnection* const other : others)
      clients.push_back(std::make_unique<ScriptedClient>(*other));
    VirtualTime::at(rt::now() + 1ms, [&] { scripted.lane->stop(); });
    scripted.run();
    for (const ScriptedConnection* const other : others) {
      EXPECT_EQ(other->taken_count, 1);
      EXPECT_LE(other->last_taken, 64 + static_cast<int>(Attention::kStreakMax));
    }
    EXPECT_GT(hot.taken_count, 300);
    scripted.lane->close();
  }
}

TEST(LaneLoop, SleepsWithoutATimeoutOnlyWhenIdle) {
  VirtualTime::start(kClockCost);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  ScriptedConnection* connection = nullptr;
  std::vector<MonotonicTime> sleeps;
  std::optional<ScriptedClient> client;
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    sleeps.push_back(until);
    switch (sleeps.size()) {
      case 1:
        connection = &scripted.connect();
        return;
      case 2:
        client.emplace(*connection);
        return;
      case 3:
        client->begin(echo::kEcho.id);
        return;
      default:
        EXPECT_EQ(connection->sent.size(), 2) << "the welcome and the reply";
        scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleeps, std::vector<MonotonicTime>(4, kNever));
  EXPECT_EQ(scripted.servant.order().size(), 1);
  EXPECT_EQ(connection->sent.size(), 3) << "at last it says that it stops";
  scripted.lane->close();
}

TEST(LaneLoop, HandlesARingWhileItGoesToSleep) {
  VirtualTime::start(kClockCost);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  int sleep_count = 0;
  scripted.wait_set->on_sleep = [&](MonotonicTime) {
    // There is no second ring for the connection that is handed over now.
    if (++sleep_count < 100) {
      scripted.connect();
    } else {
      scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleep_count, 100);
  EXPECT_EQ(scripted.lane->counters().connection_count, 99);
  scripted.lane->close();
}

/// Answers with a stream that never ends.
class Streaming final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    writer = context.deferral->stream();
    if (has_item) {
      EXPECT_TRUE(writer.write(Bytes(8), 8));
    }
    return {};
  }
  ItemWriter writer;
  bool has_item = false;
};

// Readers fall silent: the lane wakes by itself when each reader's patience ends, and not before.
TEST(LaneLoop, SleepsUntilTheNextOpenCallIsDue) {
  VirtualTime::start(0ns);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  Streaming streaming;
  scripted.add(streaming);
  ScriptedConnection& impatient = scripted.connect();
  ScriptedConnection& patient = scripted.connect();
  ScriptedClient impatient_client(impatient);
  ScriptedClient patient_client(patient);
  std::vector<MonotonicTime> sleeps;
  const MonotonicTime begun = rt::now();
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    sleeps.push_back(until);
    if (sleeps.size() == 1) {
      patient_client.begin(echo::kEcho.id, /*stream_window=*/4, /*budget_us=*/50'000, 2);
      impatient_client.begin(echo::kEcho.id, /*stream_window=*/4, /*budget_us=*/20'000, 2);
    } else if (until == kNever) {
      EXPECT_EQ(streaming.writer.ending(), CallEnding::kSilent);
      scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleeps, (std::vector<MonotonicTime>{kNever, begun + 20ms, begun + 50ms, kNever}));
  scripted.lane->close();
}

TEST(LaneLoop, RetriesAStreamEachMillisecondOverAFullConnection) {
  VirtualTime::start(0ns);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  Streaming streaming;
  streaming.has_item = true;
  scripted.add(streaming);
  ScriptedConnection& connection = scripted.connect();
  ScriptedClient client(connection);
  std::vector<MonotonicTime> sleeps;
  const MonotonicTime begun = rt::now();
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    sleeps.push_back(until);
    connection.has_capacity = sleeps.size() == 4;
    if (sleeps.size() == 1) client.begin(echo::kEcho.id, /*stream_window=*/4, 60'000'000, 2);
    if (sleeps.size() < 5) {
      EXPECT_EQ(connection.sent.size(), 1) << "the welcome";
    } else {
      EXPECT_EQ(connection.sent.size(), 2) << "and the item";
      scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleeps, (std::vector<MonotonicTime>{kNever, begun + 1ms, begun + 2ms, begun + 3ms,
                                                begun + 60s}));
  scripted.lane->close();
}

TEST(LaneLoop, CountsACallThatEndsAtItsDeadlineAsLate) {
  VirtualTime::start(0ns);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  scripted.servant.pace = 1ms;
  ScriptedConnection& connection = scripted.connect();
  ScriptedClient client(connection);
  int sleep_count = 0;
  scripted.wait_set->on_sleep = [&](MonotonicTime) {
    EXPECT_EQ(scripted.lane->counters().late_count, sleep_count == 2 ? 1 : 0);
    if (sleep_count == 2) return scripted.lane->stop();
    client.begin(echo::kEcho.id, /*stream_window=*/0, sleep_count++ == 0 ? 1001 : 1000);
  };
  scripted.run();
  EXPECT_EQ(scripted.servant.order().size(), 2);
  scripted.lane->close();
}

// All slots are taken: a new connection replaces one without a session after two seconds.
TEST(LaneLoop, ReplacesAConnectionThatIsSilentForTooLong) {
  constexpr std::uint64_t kCount = 128;
  VirtualTime::start(0ns);
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  int sleep_count = 0;
  const MonotonicTime begun = rt::now();
  scripted.wait_set->on_sleep = [&](MonotonicTime) {
    const ServerCounters counters = scripted.lane->counters();
    switch (++sleep_count) {
      case 1:
      case 2:
        for (std::uint64_t i = 0; i < kCount / 2; ++i)
          scripted.connect();
        return;
      case 3:
      case 4:
        EXPECT_EQ(counters.connection_count, kCount);
        EXPECT_EQ(counters.connection_refused_count, sleep_count == 3 ? 0 : 1);
        rt::sleep_until(begun + (sleep_count == 3 ? 2s - 1ns : 2s));
        scripted.connect();
        return;
      default:
        EXPECT_EQ(counters.connection_count, kCount + 1);
        EXPECT_EQ(counters.connection_refused_count, 1);
        EXPECT_EQ(counters.connection_lost_count, 1);
        scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleep_count, 5);
  scripted.lane->close();
}

/// Calls one method every `period`, `count` times, and records which calls found the lane asleep.
class SteadyCaller {
 public:
  SteadyCaller(ScriptedLane& scripted, Duration period, int count)
      : scripted_(scripted),
        period_(period),
        count_(count),
        connection_(scripted.connect()),
        client_(connection_) {
    VirtualTime::at(rt::now() + period, [this] { call(); });
  }
  std::vector<bool> found_asleep;

 private:
  void call() {
    if (static_cast<int>(found_asleep.size()) == count_) return scripted_.lane->stop();
    found_asleep.push_back(scripted_.wait_set->is_asleep);
    client_.begin(echo::kEcho.id);
    VirtualTime::at(rt::now() + period_, [this] { call(); });
  }

  ScriptedLane& scripted_;
  Duration period_;
  int count_;
  ScriptedConnection& connection_;
  ScriptedClient client_;
};

// At 1 kHz the lane sleeps most of the time, and is awake when the call comes.
TEST(LaneLoop, IsAwakeForAPeriodicCaller) {
  if (rt::usable_cpu_count() == 1) GTEST_SKIP() << "one CPU: such a lane blocks";
  VirtualTime::start(kClockCost);
  ScriptedLane scripted(rt::WaitStrategy::kPeriodic);
  constexpr int kCount = 500;
  SteadyCaller caller(scripted, 1ms, kCount);
  scripted.run();
  ASSERT_EQ(caller.found_asleep.size(), kCount);
  EXPECT_EQ(std::count(caller.found_asleep.begin() + 100, caller.found_asleep.end(), true), 0);
  EXPECT_GT(scripted.wait_set->slept, kCount * 1ms * 0.8);
  scripted.lane->close();
}

// A lane keeps the promise of rt::SpinEstimator: it does not spin for calls that always come later.
TEST(LaneLoop, StopsPollingForACallerThatAlwaysComesLater) {
  VirtualTime::start(kClockCost);
  ScriptedLane scripted(rt::WaitStrategy::kAdaptive);
  constexpr int kCount = 500;
  SteadyCaller caller(scripted, 1ms, kCount);
  scripted.run();
  EXPECT_GT(scripted.wait_set->slept, kCount * 1ms * 0.99);
  scripted.lane->close();
}

TEST(LaneLoop, PollsForItsSpinTimeAfterACall) {
  if (rt::usable_cpu_count() == 1) GTEST_SKIP() << "one CPU: such a lane blocks";
  VirtualTime::start(kClockCost);
  ScriptedLane scripted(rt::WaitStrategy::kAdaptive);
  MonotonicTime called{};
  std::vector<Duration> polled;
  ScriptedConnection& connection = scripted.connect();
  ScriptedClient client(connection);
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    EXPECT_EQ(until, kNever);
    if (called != MonotonicTime{}) polled.push_back(rt::now() - called);
    if (polled.size() == 2) return scripted.lane->stop();
    called = rt::now();
    client.begin(echo::kEcho.id);
  };
  scripted.run();
  ASSERT_EQ(polled.size(), 2);
  for (const Duration time : polled) {
    EXPECT_GE(time, rt::WaitConfig{}.spin);
    EXPECT_LT(time, rt::WaitConfig{}.spin + 20us);
  }
  scripted.lane->close();
}

}  // namespace
}  // namespace rtpm::rpc
