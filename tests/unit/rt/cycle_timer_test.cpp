#include "rtpm/rt/cycle_timer.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

TEST(CycleTimer, WaitsUntilACycleIsDue) {
  const MonotonicTime begin = now() + 2ms;
  const CycleTimer cycle(1ms, begin);
  cycle.wait();
  EXPECT_GE(now(), begin);
}

// This period is too long to be missed.
TEST(CycleTimer, CountsNoOverrunOfACycleInTime) {
  const MonotonicTime begin = now();
  CycleTimer cycle(1h, begin);
  cycle.wait();
  cycle.finish();
  EXPECT_EQ(cycle.due(), begin + 1h);
  EXPECT_EQ(cycle.overrun_count(), 0u);
}

TEST(CycleTimer, SkipsAndCountsMissedCycles) {
  const MonotonicTime begin = now() - 10h - 30min;
  CycleTimer cycle(1h, begin);
  cycle.wait();  // The deadline has passed: it returns at once.
  cycle.finish();
  // Ten more cycles became due during the wait, and the tenth is still current.
  EXPECT_EQ(cycle.due(), begin + 10h);
  EXPECT_EQ(cycle.overrun_count(), 10u);
  cycle.wait();
  cycle.finish();
  EXPECT_EQ(cycle.due(), begin + 11h);
  EXPECT_EQ(cycle.overrun_count(), 10u);
}

}  // namespace
}  // namespace rtpm::rt
