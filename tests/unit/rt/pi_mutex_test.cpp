#include "rtpm/rt/pi_mutex.hpp"

#include <gtest/gtest.h>

#include <mutex>
#include <thread>
#include <vector>

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

using PiMutexDeathTest = testing::Test;

TEST(PiMutexDeathTest, LockedTwiceByOneThreadIsABug) {
  EXPECT_DEATH(
      {
        PiMutex mutex;
        mutex.lock();
        mutex.lock();
      },
      "a mutex is locked once per thread");
}

TEST(PiMutexDeathTest, UnlockedByAnotherThreadIsABug) {
  EXPECT_DEATH(
      {
        PiMutex mutex;
        mutex.lock();
        std::thread([&] { mutex.unlock(); }).join();
      },
      "the thread that locked a mutex unlocks it");
}

}  // namespace
}  // namespace rtpm::rt
