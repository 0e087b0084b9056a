#pragma once

#include <gtest/gtest.h>

#include <mutex>
#include <thread>
#include <vector>

/// The guarantees of every kind of mutex.
namespace rtpm::rt {

template <class Mutex>
void expect_one_thread_at_a_time(Mutex& mutex) {
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

}  // namespace rtpm::rt
