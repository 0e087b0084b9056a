#include "rtpm/base/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

namespace rtpm {
namespace {

using std::chrono::hours;
using std::chrono::nanoseconds;

/// The value that percentile() approximates, computed from the samples themselves: the smallest
/// sample that at least `percent` of them do not exceed.
std::int64_t exact_percentile(std::vector<std::int64_t> samples, double percent) {
  std::sort(samples.begin(), samples.end());
  const auto wanted = static_cast<std::size_t>(
      std::max(1.0, std::ceil(percent / 100.0 * static_cast<double>(samples.size()))));
  return samples[wanted - 1];
}

/// Samples from 1 ns to 1 s, with evenly distributed orders of magnitude.
std::vector<std::int64_t> wide_samples(std::size_t count) {
  std::mt19937_64 random(20260);
  std::uniform_real_distribution<double> magnitude(0.0, 9.0);
  std::vector<std::int64_t> samples(count);
  for (auto& sample : samples)
    sample = static_cast<std::int64_t>(std::pow(10.0, magnitude(random)));
  return samples;
}

constexpr double kPercents[] = {0, 0.01, 1, 10, 50, 90, 99, 99.9, 99.99, 100};

TEST(LatencyHistogram, IsZeroWithoutSamplesAndAfterClearing) {
  LatencyHistogram histogram;
  const auto expect_zero = [&] {
    EXPECT_EQ(histogram.count(), 0u);
    EXPECT_EQ(histogram.min(), nanoseconds(0));
    EXPECT_EQ(histogram.max(), nanoseconds(0));
    EXPECT_EQ(histogram.mean(), nanoseconds(0));
    EXPECT_EQ(histogram.percentile(50), nanoseconds(0));
  };
  expect_zero();
  histogram.record(nanoseconds(100));
  histogram.clear();
  expect_zero();
}

TEST(LatencyHistogram, PercentilesAgreeWithSortedSamplesWithinThePromisedWidth) {
  const auto samples = wide_samples(50'000);
  LatencyHistogram histogram;
  for (const std::int64_t sample : samples)
    histogram.record(nanoseconds(sample));
  for (const double percent : kPercents) {
    const auto exact = exact_percentile(samples, percent);
    const auto shown = histogram.percentile(percent).count();
    EXPECT_GE(shown, exact) << "at " << percent << " %: never too low";
    EXPECT_LE(static_cast<double>(shown), 1.016 * static_cast<double>(exact)) << "at " << percent;
  }
}

TEST(LatencyHistogram, KeepsTheExtremesAndTheMeanExactly) {
  LatencyHistogram histogram;
  for (const int sample : {1'000'003, 17, 250'001})
    histogram.record(nanoseconds(sample));
  EXPECT_EQ(histogram.min(), nanoseconds(17));
  EXPECT_EQ(histogram.max(), nanoseconds(1'000'003));
  EXPECT_EQ(histogram.percentile(100), nanoseconds(1'000'003)) << "never above max()";
  EXPECT_EQ(histogram.mean(), nanoseconds((1'000'003 + 17 + 250'001) / 3));
}

TEST(LatencyHistogram, ResolvesSmallLatenciesToTheNanosecond) {
  LatencyHistogram histogram;
  for (int sample = 0; sample < 64; ++sample)
    histogram.record(nanoseconds(sample));
  EXPECT_EQ(histogram.percentile(50), nanoseconds(31));
  EXPECT_EQ(histogram.percentile(0), nanoseconds(0));
}

TEST(LatencyHistogram, CountsANegativeLatencyAsZero) {
  LatencyHistogram histogram;
  histogram.record(nanoseconds(-5));
  EXPECT_EQ(histogram.count(), 1u);
  EXPECT_EQ(histogram.max(), nanoseconds(0));
}

TEST(LatencyHistogram, AcceptsLatenciesBeyondItsRange) {
  LatencyHistogram histogram;
  histogram.record(nanoseconds(1));
  histogram.record(hours(10'000));
  EXPECT_EQ(histogram.count(), 2u);
  EXPECT_EQ(histogram.max(), hours(10'000));
  EXPECT_EQ(histogram.percentile(50), nanoseconds(1));
}

}  // namespace
}  // namespace rtpm
