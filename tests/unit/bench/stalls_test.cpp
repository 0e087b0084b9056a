#include "figures/stalls.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <array>

#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

/// Keeps threads of every priority off a CPU for `time`.
void take_cpu(int cpu, Duration time) {
  auto thread = rt::Thread::start({.name = "test-taker", .cpus = {cpu}}, [time] {
    const sched_param parameter{.sched_priority = sched_get_priority_max(SCHED_FIFO)};
    ASSERT_EQ(sched_setscheduler(0, SCHED_FIFO, &parameter), 0);
    const MonotonicTime end = rt::now() + time;
    while (rt::now() < end) {
    }
  });
  ASSERT_TRUE(thread);
}

TEST(StallDetector, NoticesAStallOfItsCpu) {
  if (!rtpm::test::has_realtime_right()) GTEST_SKIP() << rtpm::test::kNoRealtimeRight;
  const std::array<int, 1> cpus{sched_getcpu()};
  StallDetector detector;
  ASSERT_TRUE(detector.start(cpus));
  rt::sleep_until(rt::now() + 10ms);
  const std::uint64_t before = detector.count();
  take_cpu(cpus[0], 10ms);
  rt::sleep_until(rt::now() + 10ms);
  EXPECT_GT(detector.count(), before);
}

// The time that a CPU spends on other threads or asleep does not count as stolen. A hypervisor may
// steal some at any time, but not in each attempt.
TEST(StolenTime, ExcludesWorkAndSleep) {
  const std::array<int, 1> cpus{sched_getcpu()};
  if (!StolenTime(cpus).most()) GTEST_SKIP() << "no se.exec_start in /proc/thread-self/sched";
  EXPECT_TRUE(rtpm::test::await([&] {
    const StolenTime stolen(cpus);
    for (const MonotonicTime end = rt::now() + 10ms; rt::now() < end;) {
    }
    rt::sleep_until(rt::now() + 10ms);
    return stolen.most() < 1ms;
  }));
}

TEST(StolenTime, RestoresTheAffinityOfItsThread) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  const std::array<int, 1> cpus{sched_getcpu()};
  static_cast<void>(StolenTime(cpus).most());
  cpu_set_t after;
  ASSERT_EQ(sched_getaffinity(0, sizeof after, &after), 0);
  EXPECT_TRUE(CPU_EQUAL(&before, &after));
}

// A CPU that does not exist has no figures.
TEST(StolenTime, IsUnknownForAnAbsentCpu) {
  const std::array<int, 1> cpus{CPU_SETSIZE - 1};
  EXPECT_EQ(StolenTime(cpus).most(), std::nullopt);
}

}  // namespace
}  // namespace rtpm::bench
