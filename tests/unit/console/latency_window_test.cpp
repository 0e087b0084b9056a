#include "live/latency_window.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace rtpm::console {
namespace {

using std::chrono::microseconds;
using std::chrono::seconds;

TEST(LatencyWindows, HavePercentilesAndContiguousBins) {
  LatencyWindow window;
  MonotonicTime now{};
  for (int i = 1; i <= 1000; ++i)
    window.record(now, microseconds{i});
  const LatencySummary summary = window.summary(now);
  EXPECT_EQ(summary.p50_us, 500);
  EXPECT_EQ(summary.p90_us, 900);
  EXPECT_EQ(summary.p99_us, 990);
  EXPECT_EQ(summary.p999_us, 999);
  EXPECT_EQ(summary.max_us, 1000);
  EXPECT_EQ(summary.count, 1000U);
  std::uint64_t count = 0;
  double end_us = summary.histogram.front().from_us;
  for (const LatencyBin& bin : summary.histogram) {
    EXPECT_DOUBLE_EQ(bin.from_us, end_us);
    end_us = bin.to_us;
    count += bin.count;
  }
  EXPECT_EQ(count, 1000U);
  EXPECT_GE(end_us, 1000);
}

TEST(LatencyWindows, DiscardSamplesOlderThanFiveMinutes) {
  LatencyWindow window;
  window.record(MonotonicTime{}, microseconds{900});
  window.record_failure(MonotonicTime{});
  const MonotonicTime later = MonotonicTime{} + seconds{200};
  window.record(later, microseconds{100});
  EXPECT_EQ(window.summary(later).max_us, 900);
  EXPECT_EQ(window.summary(later).failed_count, 1U);
  const MonotonicTime latest = MonotonicTime{} + seconds{301};
  EXPECT_EQ(window.summary(latest).max_us, 100);
  EXPECT_EQ(window.summary(latest).failed_count, 0U);
  EXPECT_EQ(window.summary(latest + seconds{300}).count, 0U);
}

TEST(LatencyWindows, AreBounded) {
  LatencyWindow window;
  for (std::size_t i = 0; i < 2 * LatencyWindow::kCountMax; ++i)
    window.record(MonotonicTime{}, microseconds{1});
  EXPECT_EQ(window.summary(MonotonicTime{}).count, LatencyWindow::kCountMax);
}

}  // namespace
}  // namespace rtpm::console
