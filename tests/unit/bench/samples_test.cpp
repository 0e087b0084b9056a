#include "samples.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace rtpm::bench {
namespace {

using std::chrono::microseconds;

/// A round of 1 … `count` µs, each times `scale`.
void add_round(Samples& samples, int round, int count, int scale) {
  samples.begin_round(round);
  for (int i = count; i >= 1; --i)
    samples.add(microseconds{i * scale});
}

TEST(Samples, PercentilesAreTheSmallestThatSoManyDoNotExceed) {
  Samples samples(1, 1000);
  add_round(samples, 0, 1000, 1);
  EXPECT_DOUBLE_EQ(samples.round_percentile(0, 50), 500);
  EXPECT_DOUBLE_EQ(samples.round_percentile(0, 99.9), 999);
  EXPECT_DOUBLE_EQ(samples.round_percentile(0, 100), 1000);
  EXPECT_DOUBLE_EQ(samples.round_percentile(0, 0), 1);
}

TEST(Samples, ReportTheMedianOfTheRoundsButTheMaximumOfAll) {
  Samples samples(3, 100);
  add_round(samples, 0, 100, 1);
  add_round(samples, 1, 100, 10);
  add_round(samples, 2, 100, 2);
  EXPECT_EQ(samples.count(), 300u);
  EXPECT_DOUBLE_EQ(samples.percentiles().p50, 100) << "the rounds say 50, 500 and 100";
  EXPECT_DOUBLE_EQ(samples.percentiles().max, 1000);
  EXPECT_DOUBLE_EQ(samples.percentiles().p9999, 1000);
}

TEST(Samples, WithoutAnyAreZero) {
  const Samples samples(2, 10);
  EXPECT_EQ(samples.count(), 0u);
  EXPECT_DOUBLE_EQ(samples.percentiles().p50, 0);
  EXPECT_DOUBLE_EQ(samples.percentiles().max, 0);
}

TEST(Samples, ARatioIsTheMedianOfTheRoundsRatiosWithItsSpread) {
  Samples slow(3, 10);
  Samples fast(3, 10);
  const int slow_scales[] = {3, 20, 30};
  const int fast_scales[] = {1, 10, 10};
  for (int round = 0; round < 3; ++round) {
    add_round(slow, round, 10, slow_scales[round]);
    add_round(fast, round, 10, fast_scales[round]);
  }
  const Ratio ratio = ratio_at(slow, fast, 50);
  EXPECT_DOUBLE_EQ(ratio.median, 3);
  EXPECT_DOUBLE_EQ(ratio.low, 2);
  EXPECT_DOUBLE_EQ(ratio.high, 3);
}

TEST(Samples, ARatioToNothingIsZero) {
  Samples some(1, 10);
  add_round(some, 0, 10, 1);
  EXPECT_DOUBLE_EQ(ratio_at(some, Samples(1, 10), 50).median, 0);
}

TEST(MedianOf, TakesTheMiddle) {
  EXPECT_DOUBLE_EQ(median_of({}), 0);
  EXPECT_DOUBLE_EQ(median_of({9, 1, 5}), 5);
  EXPECT_DOUBLE_EQ(median_of({9, 1, 5, 6}), 5.5);
}

}  // namespace
}  // namespace rtpm::bench
