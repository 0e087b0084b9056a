#include "figures/stall_detector.hpp"

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

TEST(StallDetector, FeelsThatItsCpuStoodStill) {
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

}  // namespace
}  // namespace rtpm::bench
