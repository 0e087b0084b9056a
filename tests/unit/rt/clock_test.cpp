#include "rtpm/rt/clock.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "rtpm/rt/host.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

MonotonicTime system_time() {
  const Duration time = std::chrono::steady_clock::now().time_since_epoch();
  return time_from_ns(time.count());
}

TEST(Clock, IsTheSystemsMonotonicOne) {
  constexpr Duration kTolerance = 100ns;
  // Runs longer than the clock relies on one reading of the system's clock.
  for (const MonotonicTime end = system_time() + 20ms; system_time() < end;) {
    const MonotonicTime before = system_time();
    const MonotonicTime between = now();
    const MonotonicTime after = system_time();
    ASSERT_LE(before - kTolerance, between);
    ASSERT_LE(between, after + kTolerance);
  }
}

TEST(SleepUntil, DoesNotEndBeforeItsTime) {
  for (const Duration span : {1ns, 100'000ns, 2'000'000ns}) {
    const MonotonicTime end = now() + span;
    sleep_until(end);
    EXPECT_GE(now(), end);
  }
}

TEST(SleepUntil, ReturnsWhenItsTimeHasPassed) {
  sleep_until(now() - 1h);
  sleep_until(time_from_ns(0));
  sleep_until(MonotonicTime::min());
  EXPECT_GT(now(), time_from_ns(0)) << "and it ended";
}

TEST(Host, CountsTheCpusThatTheThreadMayUse) {
  EXPECT_EQ(usable_cpu_count(), static_cast<int>(test::cpus_of_this_thread().size()));
  EXPECT_EQ(usable_cpus(), test::cpus_of_this_thread());
  auto confined = Thread::start({.name = "one", .cpus = {usable_cpus().front()}},
                                [] { EXPECT_EQ(usable_cpu_count(), 1); });
  EXPECT_TRUE(confined) << confined.error().text();
}

TEST(Host, GivesRandomNumbers) {
  EXPECT_NE(random_u64(), random_u64());
}

}  // namespace
}  // namespace rtpm::rt
