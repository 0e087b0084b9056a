#include "rtpm/rt/budget.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr RealtimeLimit kUsual{950ms, 1s};

TEST(RealtimeLimit, DoesNotExceedTheKernelsLimit) {
  std::ifstream runtime_file("/proc/sys/kernel/sched_rt_runtime_us");
  std::int64_t runtime_us = 0;
  if (!(runtime_file >> runtime_us)) GTEST_SKIP() << "the kernel does not publish its limit";
  const RealtimeLimit limit = realtime_limit();
  if (runtime_us < 0) {
    EXPECT_FALSE(limit.is_limited());
  } else {
    EXPECT_LE(limit.runtime, std::chrono::microseconds{runtime_us});
  }
}

TEST(RealtimeBudget, IsSpentByAThreadThatRuns) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  bool must_pause = false;
  auto thread = Thread::start({.name = "runner", .priority = 5}, [&] {
    this_thread_budget() = RealtimeBudget(kUsual, now());
    // The test may have to run longer, because other processes take the CPU away.
    const MonotonicTime end = now() + 20s;
    while (!must_pause && now() < end)
      must_pause = this_thread_budget().must_pause(now());
  });
  ASSERT_TRUE(thread) << thread.error().text();
  thread->join();
  EXPECT_TRUE(must_pause);
}

}  // namespace
}  // namespace rtpm::rt
