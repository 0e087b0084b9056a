#include "rtpm/rt/periodic.hpp"

#include <gtest/gtest.h>

#include <random>

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicTime kStart = time_from_ns(5'000'000'000);
constexpr std::uint64_t kCaller = 7;

/// Calls at a steady pace; each call is late by up to `jitter`.
MonotonicTime call(ArrivalPredictor& predictor, MonotonicTime begin, Duration period, int count,
                   Duration jitter = Duration{0}, std::uint64_t caller = kCaller) {
  std::mt19937_64 random(1);
  MonotonicTime due = begin;
  for (int i = 0; i < count; ++i) {
    const Duration off = jitter == Duration{0}
                             ? jitter
                             : Duration{static_cast<std::int64_t>(
                                   random() % static_cast<std::uint64_t>(jitter.count()))};
    predictor.on_arrival(caller, due + off);
    due += period;
  }
  return due;  // The time of the next call.
}

TEST(ArrivalPredictor, PredictsNothingBeforeThereIsARhythm) {
  ArrivalPredictor predictor;
  EXPECT_FALSE(predictor.next(kStart));
  const MonotonicTime next = call(predictor, kStart, 1ms, 4);
  EXPECT_FALSE(predictor.next(next - 500us)) << "four calls are no rhythm yet";
}

TEST(ArrivalPredictor, IsAwakeWhenTheNextCallComes) {
  ArrivalPredictor predictor;
  const MonotonicTime next = call(predictor, kStart, 1ms, 30);
  const auto window = predictor.next(next - 900us);
  ASSERT_TRUE(window);
  EXPECT_LE(window->from, next - predictor.lead());
  EXPECT_GE(window->to, next);
  EXPECT_LT(window->to - window->from, 200us) << "sleeping most of the time is the point";
}

TEST(ArrivalPredictor, FollowsACallerThatDrifts) {
  ArrivalPredictor predictor;
  MonotonicTime due = kStart;
  Duration period = 1ms;
  int hit_count = 0;
  for (int i = 0; i < 400; ++i) {
    const auto window = predictor.next(due - 300us);
    if (i >= 20 && window && window->from <= due && due <= window->to) ++hit_count;
    predictor.on_arrival(kCaller, due);
    period += 500ns;  // The period is a fifth longer at the end.
    due += period;
  }
  EXPECT_GT(hit_count, 370);
}

TEST(ArrivalPredictor, IgnoresACallerWithoutARhythm) {
  ArrivalPredictor predictor;
  std::mt19937_64 random(2);
  MonotonicTime now = kStart;
  for (int i = 0; i < 200; ++i) {
    now += std::chrono::microseconds{300 + random() % 3000};
    predictor.on_arrival(kCaller, now);
  }
  EXPECT_FALSE(predictor.next(now + 100us));
}

TEST(ArrivalPredictor, DropsACallerThatStopped) {
  ArrivalPredictor predictor;
  const MonotonicTime next = call(predictor, kStart, 1ms, 30);
  EXPECT_TRUE(predictor.next(next + 1ms)) << "one missed call is none";
  EXPECT_FALSE(predictor.next(next + 20ms));
  // Then the predictor learns the period again.
  const MonotonicTime again = call(predictor, next + 1s, 1ms, 30);
  EXPECT_TRUE(predictor.next(again - 500us));
}

TEST(ArrivalPredictor, CountsSeveralCallsOfOneTurnAsOne) {
  ArrivalPredictor predictor;
  MonotonicTime due = kStart;
  for (int i = 0; i < 40; ++i) {
    predictor.on_arrival(kCaller, due);
    predictor.on_arrival(kCaller, due + 40us);
    due += 1ms;
  }
  const auto window = predictor.next(due - 500us);
  ASSERT_TRUE(window);
  EXPECT_LE(window->from, due);
  EXPECT_GE(window->to, due);
  EXPECT_GE(predictor.patience(), 40us) << "worth spinning for the second";
  EXPECT_LE(predictor.patience(), 100us);
  for (int i = 0; i < 100; ++i) {
    predictor.on_arrival(kCaller, due);
    due += 1ms;
  }
  EXPECT_LT(predictor.patience(), 1us) << "there is no second any more";
}

TEST(ArrivalPredictor, PredictsTheFirstOfSeveralCallers) {
  ArrivalPredictor predictor;
  MonotonicTime due = kStart;
  for (int i = 0; i < 30; ++i) {
    predictor.on_arrival(1, due);
    predictor.on_arrival(2, due + 400us);
    due += 1ms;
  }
  const auto first = predictor.next(due - 500us);
  ASSERT_TRUE(first);
  EXPECT_LE(first->to, due + 100us);
  predictor.on_arrival(1, due);
  const auto second = predictor.next(due + 10us);
  ASSERT_TRUE(second);
  EXPECT_GT(second->from, due + 100us);
  EXPECT_GE(second->to, due + 400us);
}

TEST(ArrivalPredictor, SpinsForAtMostASixteenthOfThePeriod) {
  ArrivalPredictor predictor;
  const MonotonicTime next = call(predictor, kStart, 1ms, 30, /*jitter=*/20us);
  Duration typical{0};
  for (int i = 0; i < 200; ++i) {
    const Duration late = i % 2 == 0 ? 20us : 200us;
    typical += late / 200;
    predictor.on_woken(kStart, kStart + late);
  }
  ASSERT_GT(predictor.lead(), typical + 100us) << "it would like to wake earlier";
  const auto window = predictor.next(next - 900us);
  ASSERT_TRUE(window);
  const Duration awake_before = next - (window->from + typical);
  EXPECT_LT(awake_before, Duration{1ms} / 16 + 20us);
  EXPECT_GT(awake_before, Duration{1ms} / 16 - 40us) << "but as early as that allows";
}

TEST(ArrivalPredictor, KeepsABoundedNumberOfCallers) {
  ArrivalPredictor predictor;
  const MonotonicTime next = call(predictor, kStart, 1ms, 30);
  for (std::uint64_t caller = 100; caller < 100 + 2 * ArrivalPredictor::kCallerCountMax; ++caller) {
    predictor.on_arrival(caller, next + std::chrono::microseconds{caller});
  }
  EXPECT_FALSE(predictor.next(next + 500us)) << "the caller silent for longest was evicted";
}

}  // namespace
}  // namespace rtpm::rt
