#include "rtpm/rt/budget.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr RealtimeLimit kUsual{950ms, 1s};
constexpr MonotonicTime kStart{1'000s};

TEST(RealtimeBudget, IsNeverSpentWithoutALimit) {
  RealtimeBudget budget;
  EXPECT_FALSE(budget.is_limited());
  budget.on_slept(kStart, kStart + 1s);
  EXPECT_FALSE(budget.is_spent(kStart + 1h));
  EXPECT_EQ(budget.overdue(kStart + 1h), 0ns);
  EXPECT_FALSE(RealtimeBudget({1s, 1s}, kStart).is_limited()) << "the kernel limits nothing";
}

// The promise to the kernel: the thread never exceeds the runtime in any second.
TEST(RealtimeBudget, KeepsAThreadThatPausesInTimeBelowTheLimit) {
  RealtimeBudget budget(kUsual, kStart);
  constexpr Duration kStep = 10us;
  std::vector<Duration> awake_at;  // Awake time up to each step.
  Duration awake{0};
  MonotonicTime now = kStart;
  while (now < kStart + 5s) {
    if (budget.is_spent(now)) {
      budget.on_slept(now, now + RealtimeBudget::kPause);
      for (Duration slept{0}; slept < RealtimeBudget::kPause; slept += kStep)
        awake_at.push_back(awake);
      now += RealtimeBudget::kPause;
      continue;
    }
    now += kStep;
    awake += kStep;
    awake_at.push_back(awake);
  }
  const auto second = static_cast<std::size_t>(1s / kStep);
  Duration most{0};
  for (std::size_t i = second; i < awake_at.size(); ++i)
    most = std::max(most, awake_at[i] - awake_at[i - second]);
  EXPECT_LT(most, kUsual.runtime);
  EXPECT_GT(most, 900ms) << "it may use most of what there is";
}

TEST(RealtimeBudget, EarnsNothingByCallsThatReturnAtOnce) {
  RealtimeBudget budget(kUsual, kStart);
  MonotonicTime now = kStart;
  for (; now < kStart + 200ms; now += 10us)
    budget.on_slept(now, now + 4us);
  // The time that the calls themselves take does not count as spent, either.
  EXPECT_TRUE(budget.is_spent(now));
}

TEST(RealtimeBudget, IsOneBurstAfterALongSleep) {
  RealtimeBudget budget(kUsual, kStart);
  budget.on_slept(kStart, kStart + 1h);
  EXPECT_FALSE(budget.is_spent(kStart + 1h + RealtimeBudget::kBurst - 1us));
  EXPECT_TRUE(budget.is_spent(kStart + 1h + RealtimeBudget::kBurst));
}

TEST(RealtimeBudget, IsOverdueAfterMissedChancesToSleep) {
  const RealtimeBudget budget(kUsual, kStart);
  const MonotonicTime spent = kStart + RealtimeBudget::kBurst;
  EXPECT_EQ(budget.overdue(spent + 1ms), 0ns);
  EXPECT_GE(budget.overdue(spent + 2ms), RealtimeBudget::kPause);
  const Duration pause = budget.overdue(spent + 100ms);
  EXPECT_GT(pause, 5ms);
  EXPECT_LT(pause, 10ms) << "a debt of 100 ms awake is some 7 ms asleep";
}

TEST(RealtimeBudget, IsLimitedForThreadsAtARealtimeLevelOnly) {
  const auto is_limited_for = [](const ThreadConfig& config) {
    bool is_limited = false;
    auto thread = Thread::start(config, [&] { is_limited = this_thread_budget().is_limited(); });
    if (!thread) {
      ADD_FAILURE() << thread.error().text();
    } else {
      thread->join();
    }
    return is_limited;
  };
  EXPECT_FALSE(is_limited_for({.name = "none"}));
  EXPECT_FALSE(is_limited_for({.name = "off", .priority = 5, .realtime = RealtimeMode::kOff}));
  EXPECT_FALSE(
      is_limited_for({.name = "shared", .priority = 5, .schedule = Schedule::kTimeShared}));
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  EXPECT_EQ(is_limited_for({.name = "fifo", .priority = 5}), realtime_limit().is_limited());
}

// A method may block by itself: that does not count as awake, and must not make its lane sleep.
TEST(RealtimeBudget, IsNotSpentByAThreadThatBlocks) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  bool was_spent = false;
  bool must_pause = true;
  auto thread = Thread::start({.name = "blocker", .priority = 5}, [&] {
    this_thread_budget() = RealtimeBudget(kUsual, now());
    test::block_for(60ms);
    was_spent = this_thread_budget().is_spent(now());
    must_pause = this_thread_budget().must_pause(now());
  });
  ASSERT_TRUE(thread) << thread.error().text();
  thread->join();
  EXPECT_TRUE(was_spent) << "the account counts blocked time";
  EXPECT_FALSE(must_pause);
}

TEST(AsleepScope, CreditsTheThreadsSleep) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  if (!realtime_limit().is_limited()) GTEST_SKIP() << "nothing limits real-time threads here";
  bool was_spent = false;
  bool is_spent_after_sleep = true;
  auto thread = Thread::start({.name = "sleeper", .priority = 5}, [&] {
    // Simulates a thread that has run for a long time.
    this_thread_budget() = RealtimeBudget(kUsual, now() - RealtimeBudget::kBurst);
    was_spent = this_thread_budget().is_spent(now());
    sleep_until(now() + 5ms);
    is_spent_after_sleep = this_thread_budget().is_spent(now());
  });
  ASSERT_TRUE(thread) << thread.error().text();
  thread->join();
  EXPECT_TRUE(was_spent);
  EXPECT_FALSE(is_spent_after_sleep);
}

}  // namespace
}  // namespace rtpm::rt
