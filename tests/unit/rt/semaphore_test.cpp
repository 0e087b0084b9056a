#include "rtpm/rt/semaphore.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

TEST(Semaphore, CountsItsPosts) {
  Semaphore semaphore;
  EXPECT_FALSE(semaphore.wait_until(now()));
  semaphore.post();
  semaphore.post();
  EXPECT_TRUE(semaphore.wait_until(kNever));
  EXPECT_TRUE(semaphore.wait_until(now() - 1h)) << "the count matters, not the time";
  EXPECT_FALSE(semaphore.wait_until(now() - 1h));
}

TEST(Semaphore, DoesNotEndAWaitBeforeItsTime) {
  Semaphore semaphore;
  for (const Duration span : {1ns, 300'000ns, 5'000'000ns}) {
    const MonotonicTime end = now() + span;
    EXPECT_FALSE(semaphore.wait_until(end));
    EXPECT_GE(now(), end);
  }
}

TEST(Semaphore, WakesAWaiter) {
  for (const bool is_timed : {false, true}) {
    Semaphore request;
    Semaphore reply;
    std::thread waiter([&] {
      EXPECT_TRUE(request.wait_until(is_timed ? now() + 20s : kNever));
      reply.post();
    });
    // Most probably the waiter sleeps by now.
    sleep_until(now() + 2ms);
    request.post();
    EXPECT_TRUE(reply.wait_until(now() + 20s));
    waiter.join();
  }
}

// A post that comes as a wait times out is not lost, and none counts twice.
TEST(Semaphore, KeepsItsCountWhenWaitsTimeOut) {
  constexpr int kPostCount = 2'000;
  Semaphore semaphore;
  std::atomic<int> taken_count{0};
  std::atomic<bool> is_ending{false};
  const auto take = [&] {
    while (!is_ending) {
      if (semaphore.wait_until(now() + 20us)) ++taken_count;
    }
  };
  std::thread first(take);
  std::thread second(take);
  for (int i = 0; i < kPostCount; ++i) {
    semaphore.post();
    if (i % 8 == 0) sleep_until(now() + 30us);
  }
  const MonotonicTime end = now() + 20s;
  while (taken_count < kPostCount && now() < end)
    sleep_until(now() + 1ms);
  is_ending = true;
  first.join();
  second.join();
  EXPECT_EQ(taken_count, kPostCount);
  EXPECT_FALSE(semaphore.wait_until(now()));
}

}  // namespace
}  // namespace rtpm::rt
