#include "rtpm/rt/parallel_jobs.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>

namespace rtpm::rt {
namespace {

TEST(ParallelJobs, RunAtTheSameTime) {
  ParallelJobs jobs("test", 8);
  // Each job ends only when all have begun.
  std::latch begun(8);
  std::atomic<int> done_count = 0;
  for (int i = 0; i < 8; ++i) {
    jobs.add([&] {
      begun.arrive_and_wait();
      ++done_count;
    });
  }
  jobs.finish();
  EXPECT_EQ(done_count, 8);
}

TEST(ParallelJobs, RunNoMoreThreadsThanTheLimit) {
  std::atomic<int> running_count = 0;
  std::atomic<int> running_max = 0;
  std::atomic<int> done_count = 0;
  {
    ParallelJobs jobs("test", 2);
    for (int i = 0; i < 100; ++i) {
      jobs.add([&] {
        const int now = ++running_count;
        int max = running_max;
        while (now > max && !running_max.compare_exchange_weak(max, now)) {
        }
        --running_count;
        ++done_count;
      });
    }
  }
  EXPECT_EQ(done_count, 100) << "the end waits for all";
  EXPECT_LE(running_max, 2);
}

TEST(ParallelJobs, AcceptJobsFromJobs) {
  ParallelJobs jobs("test", 3);
  std::atomic<int> done_count = 0;
  for (int i = 0; i < 4; ++i) {
    jobs.add([&] {
      for (int j = 0; j < 4; ++j)
        jobs.add([&] { ++done_count; });
    });
  }
  jobs.finish();
  EXPECT_EQ(done_count, 16);
  jobs.finish();
}

}  // namespace
}  // namespace rtpm::rt
