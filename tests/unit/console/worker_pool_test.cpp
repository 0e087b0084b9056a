#include "work/worker_pool.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "rtpm/test/os.hpp"

namespace rtpm::console {
namespace {

/// Work that lasts until the test ends it.
struct Held {
  std::promise<void> end{};
  std::shared_future<void> until{end.get_future()};
  std::atomic<int> begun_count{0};
};

TEST(WorkerPools, RunWorkOfOneTargetOnFewThreadsOnly) {
  WorkerPool pool;
  ASSERT_TRUE(pool.start({.thread_count = 3, .per_target_max = 2}));
  Held held;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(pool.run("dead", [&held] {
      ++held.begun_count;
      held.until.wait();
    }));
  }
  // The pool answers other targets although five calls of the dead one came first.
  std::promise<void> done;
  ASSERT_TRUE(pool.run("alive", [&done] { done.set_value(); }));
  done.get_future().wait();
  EXPECT_LE(held.begun_count, 2);
  held.end.set_value();
  pool.stop();
}

TEST(WorkerPools, RefuseWorkAboveTheLimit) {
  WorkerPool pool;
  ASSERT_TRUE(pool.start({.thread_count = 1, .per_target_max = 1, .queued_max = 2}));
  Held held;
  ASSERT_TRUE(pool.run("a", [&held] {
    ++held.begun_count;
    held.until.wait();
  }));
  ASSERT_TRUE(test::await([&] { return held.begun_count == 1; }));
  EXPECT_TRUE(pool.run("a", [] {}));
  EXPECT_TRUE(pool.run("a", [] {}));
  EXPECT_FALSE(pool.run("a", [] {}));
  held.end.set_value();
  pool.stop();
  EXPECT_FALSE(pool.run("a", [] {}));
}

}  // namespace
}  // namespace rtpm::console
