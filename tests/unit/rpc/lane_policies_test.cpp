#include <gtest/gtest.h>

#include <random>

#include "execution/idling.hpp"
#include "execution/throttling.hpp"
#include "lane/attention.hpp"

// A lane's decisions, without threads, sockets or a clock.
namespace rtpm::rpc {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicTime kStart{1'000s};
// For any frame duration, other sources wait for at most 16 frames, or for 200 us and the current
// frame.
TEST(Attention, BoundsTheWaitOfOtherSources) {
  std::mt19937_64 random(1);
  for (const bool is_memory_hot : {false, true}) {
    Attention attention;
    MonotonicTime now = kStart;
    for (int look = 0; look < 2'000; ++look) {
      attention.on_look();
      const Duration longest{static_cast<int>(random() % 100'000)};
      const MonotonicTime begin = now;
      int frame_count = 0;
      bool is_due = false;
      while (!is_due) {
        is_due = attention.is_look_due(now, is_memory_hot);
        ++frame_count;
        now += longest;
        ASSERT_LE(now - begin, Attention::kLookIntervalMax + 2 * longest);
        if (longest == Duration{0}) now += 100ns;
      }
      if (!is_memory_hot) {
        ASSERT_LE(frame_count, 16);
      }
    }
  }
}

TEST(Attention, PollsTheSystemRarelyWhileOnlyMemoryIsHot) {
  Attention attention;
  const auto looks_in = [&](Duration time, bool has_found, bool is_memory_hot) {
    int look_count = 0;
    MonotonicTime now = kStart;
    attention.on_look();
    for (const MonotonicTime end = now + time; now < end; now += 100ns) {
      attention.on_idle(now);
      if (!attention.is_idle_look_due()) continue;
      ++look_count;
      attention.on_look();
      attention.on_looked(has_found, is_memory_hot);
    }
    return look_count;
  };
  const int often = looks_in(10ms, false, false);
  EXPECT_EQ(often, looks_in(10ms, true, true)) << "while the others have frames, too";
  EXPECT_GE(often, 10ms / (2 * Attention::kLookIntervalMin));
  EXPECT_LE(looks_in(10ms, false, true), 10ms / Attention::kLookIntervalMax + 10);
}

TEST(Attention, PrefersOpenCallsForSixteenTurns) {
  Attention attention;
  for (int round = 0; round < 2; ++round) {
    for (std::uint32_t turn = 1; turn < Attention::kStreakMax; ++turn)
      ASSERT_FALSE(attention.on_own_work()) << turn;
    ASSERT_TRUE(attention.on_own_work());
    attention.on_turn();
  }
}

TEST(Idling, NeverSleepsIfTheLaneSpins) {
  Idling idling(rt::WaitConfig{.strategy = rt::WaitStrategy::kSpin, .spin = 50us});
  for (const Duration passed : {Duration{0}, Duration{1s}, Duration{1h}})
    EXPECT_TRUE(idling.on_idle(kStart + passed).polls);
}

TEST(Idling, PollsForAWhileAfterWorkIfAdaptive) {
  if (rt::usable_cpu_count() == 1) GTEST_SKIP() << "one CPU: such a lane blocks";
  Idling idling(rt::WaitConfig{.strategy = rt::WaitStrategy::kAdaptive, .spin = 50us});
  idling.on_work(kStart);
  EXPECT_TRUE(idling.on_idle(kStart + 1us).polls);
  EXPECT_TRUE(idling.on_idle(kStart + 50us).polls);
  const Idling::Next next = idling.on_idle(kStart + 52us);
  EXPECT_FALSE(next.polls);
  idling.on_woken(next, kStart + 1ms, /*has_work=*/false);
  EXPECT_FALSE(idling.on_idle(kStart + 1ms).polls) << "nothing came, so it keeps sleeping";
  idling.on_woken(next, kStart + 2ms, /*has_work=*/true);
  idling.on_work(kStart + 2ms);
  EXPECT_TRUE(idling.on_idle(kStart + 2ms + 1us).polls);
}

/// A thread's budget with the answers that a test sets.
struct FakeBudget {
  bool is_spent = false;
  bool is_in_vain = false;
  Duration debt{0};
  [[nodiscard]] bool must_pause(MonotonicTime) const noexcept { return is_spent; }
  [[nodiscard]] bool must_sleep(MonotonicTime) const noexcept { return is_in_vain; }
  [[nodiscard]] Duration overdue(MonotonicTime) const noexcept { return debt; }
};

TEST(Pauses, AreWaitsInAThreadThatPollsWhileWaitsEarn) {
  FakeBudget budget;
  EXPECT_EQ(pause_while_polling(budget, kStart).kind, Pause::Kind::kNone);
  budget.is_spent = true;
  const Pause wait = pause_while_polling(budget, kStart);
  EXPECT_EQ(wait.kind, Pause::Kind::kWait);
  EXPECT_EQ(wait.until, kStart + rt::RealtimeBudget::kPause);
  budget.is_in_vain = true;
  EXPECT_EQ(pause_while_polling(budget, kStart).kind, Pause::Kind::kSleep);
}

TEST(Pauses, AreSleepsForItsDebtInAThreadThatNeverWaits) {
  int clock_count = 0;
  const auto clock = [&] {
    ++clock_count;
    return kStart + 5ms;
  };
  FakeBudget budget{.is_spent = true};
  EXPECT_EQ(pause_after_work(budget, kStart, clock).kind, Pause::Kind::kNone);
  EXPECT_EQ(clock_count, 0) << "pauses between the work will do";
  budget.debt = 300us;
  const Pause sleep = pause_after_work(budget, kStart, clock);
  EXPECT_EQ(sleep.kind, Pause::Kind::kSleep);
  EXPECT_EQ(sleep.until, kStart + 5ms + 300us) << "from now on, not from the frame on";
  budget.is_spent = false;
  EXPECT_EQ(pause_after_work(budget, kStart, clock).kind, Pause::Kind::kNone)
      << "it slept elsewhere";
}

}  // namespace
}  // namespace rtpm::rpc
