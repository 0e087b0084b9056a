#include "figures/samples.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace rtpm::bench {
namespace {

using std::chrono::microseconds;

/// A round of 1 … `count` µs, each multiplied by `scale`.
void add_round(Samples& samples, int round, int count, int scale) {
  samples.begin_round(round);
  for (int i = count; i >= 1; --i)
    samples.add(microseconds{i * scale});
}

TEST(Samples, PercentilesAreOfTheNearestRank) {
  Samples samples(1, 1000);
  add_round(samples, 0, 1000, 1);
  EXPECT_EQ(samples.stretch_percentiles(50), std::vector<double>{500});
  EXPECT_EQ(samples.stretch_percentiles(99.9), std::vector<double>{999});
  EXPECT_EQ(samples.stretch_percentiles(0), std::vector<double>{1});
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

TEST(Samples, MergeRoundsUntilTenSamplesExceedThePercentile) {
  Samples samples(5, 500);
  for (int round = 0; round < 5; ++round)
    add_round(samples, round, 500, 1 + round);
  EXPECT_EQ(samples.stretch_percentiles(50).size(), 5u) << "each has 250 beyond";
  const std::vector<Stretch> expected{{0, 1}, {2, 3, 4}};
  EXPECT_EQ(stretches_of(samples, samples, 99), expected) << "a round has five beyond";
  EXPECT_EQ(stretches_of(samples, samples, 99.9).size(), 1u) << "too few in all";
}

TEST(Samples, ExcludeDisturbedRoundsWhileAThirdRemains) {
  Samples samples(4, 100);
  for (int round = 0; round < 4; ++round) {
    add_round(samples, round, 100, round == 0 ? 1000 : round == 1 ? 10 : 1);
    if (round < 2) samples.note_disturbed(true);
  }
  EXPECT_DOUBLE_EQ(samples.percentiles().p50, 50);
  EXPECT_DOUBLE_EQ(samples.percentiles().max, 100'000);
  EXPECT_EQ(rounds_that_count(samples, samples), (Stretch{2, 3}));
  samples.begin_round(2);
  samples.note_disturbed(true);
  EXPECT_EQ(samples.stretch_percentiles(50).size(), 4u) << "one round would be too little";
}

TEST(Samples, AreZeroIfEmpty) {
  const Samples samples(2, 10);
  EXPECT_EQ(samples.count(), 0u);
  EXPECT_DOUBLE_EQ(samples.percentiles().p50, 0);
  EXPECT_DOUBLE_EQ(samples.percentiles().max, 0);
  Samples some(1, 10);
  add_round(some, 0, 10, 1);
  EXPECT_DOUBLE_EQ(ratio_at(some, samples, 50).middle, 0);
}

TEST(Samples, RatioIsTheMedianOfTheRoundRatios) {
  Samples slow(3, 20);
  Samples fast(3, 20);
  const int slow_scales[] = {3, 20, 40};
  const int fast_scales[] = {1, 10, 10};
  for (int round = 0; round < 3; ++round) {
    add_round(slow, round, 20, slow_scales[round]);
    add_round(fast, round, 20, fast_scales[round]);
  }
  const Ratio ratio = ratio_at(slow, fast, 50);
  EXPECT_DOUBLE_EQ(ratio.middle, 3);
  EXPECT_DOUBLE_EQ(ratio.low, 2)
      << "that of the second round, which a few draws have twice or more";
  EXPECT_DOUBLE_EQ(ratio.high, 4);
}

TEST(Samples, RatioIntervalNarrowsWithAgreeingRounds) {
  constexpr int kRounds = 40;
  Samples slow(kRounds, 500);
  Samples fast(kRounds, 500);
  for (int round = 0; round < kRounds; ++round) {
    add_round(slow, round, 500, round == 7 ? 400 : 20 + round % 3);
    add_round(fast, round, 500, 10);
  }
  const Ratio at_median = ratio_at(slow, fast, 50);
  EXPECT_GE(at_median.low, 2.0);
  EXPECT_LE(at_median.high, 2.2) << "one round that ran wild says nothing";
  const Ratio at_tail = ratio_at(slow, fast, 99.9);
  EXPECT_EQ(at_tail.stretches.size(), 2u);
  EXPECT_GT(at_tail.high, 10) << "a tail may be that round's";
  EXPECT_LE(at_tail.low, at_tail.middle);
}

TEST(Samples, RatioUsesOnlyRoundsThatBothKeep) {
  Samples slow(2, 100);
  Samples fast(2, 100);
  for (int round = 0; round < 2; ++round) {
    add_round(slow, round, 100, round == 0 ? 50 : 3);
    add_round(fast, round, 100, 1);
    if (round == 0) fast.note_disturbed(true);
  }
  EXPECT_DOUBLE_EQ(ratio_at(slow, fast, 50).middle, 3);
}

TEST(Samples, ListEveryLatencyInOrder) {
  Samples samples(2, 2);
  for (int round = 0; round < 2; ++round) {
    samples.begin_round(round);
    samples.add(microseconds{1 + round});
    samples.add(microseconds{5 + round});
  }
  EXPECT_EQ(samples.all_us(), (std::vector<double>{1, 5, 2, 6}));
}

TEST(MiddleOf, IsTheMeanOfTheMiddleHalf) {
  EXPECT_DOUBLE_EQ(middle_of({}), 0);
  EXPECT_DOUBLE_EQ(middle_of({7}), 7);
  EXPECT_DOUBLE_EQ(middle_of({7, 8}), 7.5);
  EXPECT_DOUBLE_EQ(middle_of({9, 1, 5}), 5);
  EXPECT_DOUBLE_EQ(middle_of({9, 1, 5, 6}), 5.5);
  EXPECT_DOUBLE_EQ(middle_of({900, 1, 2, 3, 4, -5, 6, 800}), 3.75) << "wild ones do not count";
  EXPECT_DOUBLE_EQ(middle_of({2, 2, 2, 4, 4, 4}), 3) << "and it lies between two heaps";
}

}  // namespace
}  // namespace rtpm::bench
