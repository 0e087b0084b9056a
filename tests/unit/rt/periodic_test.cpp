#include "rtpm/rt/periodic.hpp"

#include <gtest/gtest.h>

#include <random>

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicTime kStart = time_from_ns(5'000'000'000);
constexpr std::uint64_t kCaller = 7;

/// Calls at a pace; every call off by up to `jitter`.
MonotonicTime call(Foresight& foresight, MonotonicTime begin, Duration period, int count,
                   Duration jitter = Duration{0}, std::uint64_t caller = kCaller) {
  std::mt19937_64 random(1);
  MonotonicTime due = begin;
  for (int i = 0; i < count; ++i) {
    const Duration off = jitter == Duration{0}
                             ? jitter
                             : Duration{static_cast<std::int64_t>(
                                   random() % static_cast<std::uint64_t>(jitter.count()))};
    foresight.on_arrival(caller, due + off);
    due += period;
  }
  return due;  // When the next would come.
}

TEST(Foresight, SeesNothingBeforeThereIsARhythm) {
  Foresight foresight;
  EXPECT_FALSE(foresight.next(kStart));
  const MonotonicTime next = call(foresight, kStart, 1ms, 4);
  EXPECT_FALSE(foresight.next(next - 500us)) << "four calls are no rhythm yet";
}

TEST(Foresight, IsAwakeWhenTheNextCallComes) {
  Foresight foresight;
  const MonotonicTime next = call(foresight, kStart, 1ms, 30);
  const auto window = foresight.next(next - 900us);
  ASSERT_TRUE(window);
  EXPECT_LE(window->from, next - foresight.lead());
  EXPECT_GE(window->to, next);
  EXPECT_LT(window->to - window->from, 200us) << "sleeping most of the time is the point";
}

TEST(Foresight, FollowsACallerThatDrifts) {
  Foresight foresight;
  MonotonicTime due = kStart;
  Duration period = 1ms;
  int hit_count = 0;
  for (int i = 0; i < 400; ++i) {
    const auto window = foresight.next(due - 300us);
    if (i >= 20 && window && window->from <= due && due <= window->to) ++hit_count;
    foresight.on_arrival(kCaller, due);
    period += 500ns;  // A fifth slower in the end.
    due += period;
  }
  EXPECT_GT(hit_count, 370);
}

TEST(Foresight, WidensItsWindowForJitter) {
  Foresight steady;
  Foresight shaky;
  const MonotonicTime next = call(steady, kStart, 2ms, 60);
  static_cast<void>(call(shaky, kStart, 2ms, 60, 40us));
  const auto narrow = steady.next(next - 1ms);
  const auto wide = shaky.next(next - 1ms);
  ASSERT_TRUE(narrow && wide);
  EXPECT_GT(wide->to - wide->from, narrow->to - narrow->from + 40us);
}

TEST(Foresight, GivesUpACallerWithoutARhythm) {
  Foresight foresight;
  std::mt19937_64 random(2);
  MonotonicTime now = kStart;
  for (int i = 0; i < 200; ++i) {
    now += std::chrono::microseconds{300 + random() % 3000};
    foresight.on_arrival(kCaller, now);
  }
  EXPECT_FALSE(foresight.next(now + 100us));
}

TEST(Foresight, ForgetsACallerThatStopped) {
  Foresight foresight;
  const MonotonicTime next = call(foresight, kStart, 1ms, 30);
  EXPECT_TRUE(foresight.next(next + 1ms)) << "one missed call is none";
  EXPECT_FALSE(foresight.next(next + 20ms));
  // And comes to know it again.
  const MonotonicTime again = call(foresight, next + 1s, 1ms, 30);
  EXPECT_TRUE(foresight.next(again - 500us));
}

TEST(Foresight, ExpectsTheTurnAfterAMissedCall) {
  Foresight foresight;
  const MonotonicTime next = call(foresight, kStart, 1ms, 30);
  const auto window = foresight.next(next + 500us);
  ASSERT_TRUE(window);
  EXPECT_LE(window->from, next + 1ms);
  EXPECT_GE(window->to, next + 1ms);
  foresight.on_arrival(kCaller, next + 1ms);
  EXPECT_TRUE(foresight.next(next + 1500us)) << "the rhythm is kept";
}

TEST(Foresight, TakesSeveralCallsOfOneTurnAsOne) {
  Foresight foresight;
  MonotonicTime due = kStart;
  for (int i = 0; i < 40; ++i) {
    foresight.on_arrival(kCaller, due);
    foresight.on_arrival(kCaller, due + 40us);
    due += 1ms;
  }
  const auto window = foresight.next(due - 500us);
  ASSERT_TRUE(window);
  EXPECT_LE(window->from, due);
  EXPECT_GE(window->to, due);
  EXPECT_GE(foresight.patience(), 40us) << "worth spinning for the second";
  EXPECT_LE(foresight.patience(), 100us);
  for (int i = 0; i < 100; ++i) {
    foresight.on_arrival(kCaller, due);
    due += 1ms;
  }
  EXPECT_LT(foresight.patience(), 1us) << "there is no second any more";
}

TEST(Foresight, SeesTheFirstOfSeveralCallers) {
  Foresight foresight;
  MonotonicTime due = kStart;
  for (int i = 0; i < 30; ++i) {
    foresight.on_arrival(1, due);
    foresight.on_arrival(2, due + 400us);
    due += 1ms;
  }
  const auto first = foresight.next(due - 500us);
  ASSERT_TRUE(first);
  EXPECT_LE(first->to, due + 100us);
  foresight.on_arrival(1, due);
  const auto second = foresight.next(due + 10us);
  ASSERT_TRUE(second);
  EXPECT_GT(second->from, due + 100us);
  EXPECT_GE(second->to, due + 400us);
}

TEST(Foresight, LearnsHowLateItWakes) {
  Foresight foresight;
  for (int i = 0; i < 100; ++i)
    foresight.on_woken(kStart, kStart + 20us);
  EXPECT_GE(foresight.lead(), 20us);
  EXPECT_LE(foresight.lead(), 30us);
  for (int i = 0; i < 100; ++i)
    foresight.on_woken(kStart, kStart + 150us);
  EXPECT_GE(foresight.lead(), 150us);
  EXPECT_LE(foresight.lead(), 250us) << "there is a limit to how early it is worth it";
}

TEST(Foresight, SpinsForNoMoreThanASixteenthOfThePeriodHoweverUncertainWakingIs) {
  Foresight foresight;
  const MonotonicTime next = call(foresight, kStart, 1ms, 30, /*jitter=*/20us);
  Duration typical{0};
  for (int i = 0; i < 200; ++i) {
    const Duration late = i % 2 == 0 ? 20us : 200us;
    typical += late / 200;
    foresight.on_woken(kStart, kStart + late);
  }
  ASSERT_GT(foresight.lead(), typical + 100us) << "it would like to wake earlier";
  const auto window = foresight.next(next - 900us);
  ASSERT_TRUE(window);
  const Duration awake_before = next - (window->from + typical);
  EXPECT_LT(awake_before, Duration{1ms} / 16 + 20us);
  EXPECT_GT(awake_before, Duration{1ms} / 16 - 40us) << "but as early as that allows";
}

TEST(Foresight, KeepsABoundedNumberOfCallers) {
  Foresight foresight;
  const MonotonicTime next = call(foresight, kStart, 1ms, 30);
  for (std::uint64_t caller = 100; caller < 100 + 2 * Foresight::kCallerCountMax; ++caller) {
    foresight.on_arrival(caller, next + std::chrono::microseconds{caller});
  }
  EXPECT_FALSE(foresight.next(next + 500us)) << "the one heard longest ago made room";
}

}  // namespace
}  // namespace rtpm::rt
