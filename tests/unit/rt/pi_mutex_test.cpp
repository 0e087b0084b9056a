#include "rtpm/rt/pi_mutex.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

TEST(PiMutex, LetsOneThreadInAtATime) {
  PiMutex mutex;
  int unguarded_count = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int round = 0; round < 10'000; ++round) {
        const std::lock_guard lock(mutex);
        ++unguarded_count;
      }
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(unguarded_count, 40'000);
}

TEST(PiMutex, CanBeTried) {
  PiMutex mutex;
  ASSERT_TRUE(mutex.try_lock());
  bool is_free_there = true;
  std::thread([&] { is_free_there = mutex.try_lock(); }).join();
  EXPECT_FALSE(is_free_there);
  mutex.unlock();
  std::thread([&] {
    is_free_there = mutex.try_lock();
    if (is_free_there) mutex.unlock();
  }).join();
  EXPECT_TRUE(is_free_there);
}

// Otherwise a thread of middle priority could preempt the holder, and so block the urgent waiter.
TEST(PiMutex, RaisesItsHolderToTheMostUrgentWaiter) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  constexpr Priority kLow{1'000};
  constexpr Priority kHigh{30'000};
  PiMutex mutex;
  std::atomic<pid_t> holder{0};
  std::atomic<bool> may_release{false};
  std::atomic<bool> had_it{false};
  auto low = Thread::start({.name = "holder", .priority = kLow}, [&] {
    mutex.lock();
    holder = gettid();
    static_cast<void>(test::await([&] { return may_release.load(); }));
    mutex.unlock();
  });
  ASSERT_TRUE(low);
  ASSERT_TRUE(test::await([&] { return holder != 0; }));
  EXPECT_EQ(test::effective_level(holder), to_native(kLow));
  auto high = Thread::start({.name = "waiter", .priority = kHigh}, [&] {
    mutex.lock();
    had_it = true;
    mutex.unlock();
  });
  ASSERT_TRUE(high);
  EXPECT_TRUE(test::await([&] { return test::effective_level(holder) == to_native(kHigh); }));
  EXPECT_FALSE(had_it);
  may_release = true;
  high->join();
  low->join();
  EXPECT_TRUE(had_it);
}

using PiMutexDeathTest = testing::Test;

// An alarm ends a mutex that deadlocks with itself instead.
TEST(PiMutexDeathTest, LockedTwiceByOneThreadIsABug) {
  EXPECT_EXIT(
      {
        alarm(10);
        PiMutex mutex;
        mutex.lock();
        mutex.lock();
      },
      testing::KilledBySignal(SIGABRT), "a mutex is locked once per thread");
}

TEST(PiMutexDeathTest, UnlockedByAnotherThreadIsABug) {
  EXPECT_EXIT(
      {
        PiMutex mutex;
        mutex.lock();
        std::thread([&] { mutex.unlock(); }).join();
      },
      testing::KilledBySignal(SIGABRT), "the thread that locked a mutex unlocks it");
}

}  // namespace
}  // namespace rtpm::rt
