#include "rtpm/rt/ceiling_mutex.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "mutex_checks.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr Priority kLow{1'000};
constexpr Priority kHigh{20'000};
constexpr Priority kHigher{30'000};

TEST(CeilingMutex, LetsOneThreadInAtATime) {
  CeilingMutex mutex(kHigh);
  expect_one_thread_at_a_time(mutex);
}

TEST(CeilingMutex, LeavesATimeSharedThreadTimeShared) {
  CeilingMutex mutex(kHigh);
  std::thread([&] {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(test::scheduling_of_this_thread(), test::kTimeShared);
  }).join();
}

class CeilingMutexLevels : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  }
  static void run_at(Priority priority, const std::function<void()>& body) {
    auto thread = Thread::start({.name = "taker", .priority = priority}, body);
    ASSERT_TRUE(thread) << thread.error().text();
    thread->join();
  }
  static int level() { return test::scheduling_of_this_thread().level; }
};

TEST_F(CeilingMutexLevels, RaisesItsHolderAtOnceAndPutsItBack) {
  CeilingMutex mutex(kHigh);
  run_at(kLow, [&] {
    mutex.lock();
    EXPECT_EQ(level(), to_native(kHigh));
    mutex.unlock();
    EXPECT_EQ(level(), to_native(kLow));
    EXPECT_TRUE(mutex.try_lock());
    EXPECT_EQ(level(), to_native(kHigh));
    mutex.unlock();
    EXPECT_EQ(level(), to_native(kLow));
  });
}

TEST_F(CeilingMutexLevels, LeavesAHolderAboveTheCeilingWhereItIs) {
  CeilingMutex mutex(kHigh);
  run_at(kHigher, [&] {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(level(), to_native(kHigher));
  });
}

TEST_F(CeilingMutexLevels, NestInBothDirections) {
  CeilingMutex outer(kHigh);
  CeilingMutex inner(kHigher);
  run_at(kLow, [&] {
    {
      const std::lock_guard outer_lock(outer);
      {
        const std::lock_guard inner_lock(inner);
        EXPECT_EQ(level(), to_native(kHigher));
      }
      EXPECT_EQ(level(), to_native(kHigh));
    }
    EXPECT_EQ(level(), to_native(kLow));
  });
}

TEST_F(CeilingMutexLevels, OfAThreadThatDidNotGetItAreAsBefore) {
  CeilingMutex mutex(kHigh);
  mutex.lock();
  run_at(kLow, [&] {
    EXPECT_FALSE(mutex.try_lock());
    EXPECT_EQ(level(), to_native(kLow));
    EXPECT_FALSE(mutex.try_lock_until(now() + 1ms));
    EXPECT_EQ(level(), to_native(kLow));
  });
  mutex.unlock();
}

// A time-shared holder can't be raised beforehand; it is as soon as somebody waits for it.
TEST_F(CeilingMutexLevels, ATimeSharedHolderInheritsThePriorityOfWhoWaits) {
  CeilingMutex mutex(kHigh);
  std::atomic<pid_t> holder{0};
  std::atomic<bool> may_release{false};
  std::thread low([&] {
    const std::lock_guard lock(mutex);
    holder = gettid();
    static_cast<void>(test::await([&] { return may_release.load(); }));
  });
  ASSERT_TRUE(test::await([&] { return holder != 0; }));
  auto high = Thread::start({.name = "waiter", .priority = kLow},
                            [&] { const std::lock_guard lock(mutex); });
  ASSERT_TRUE(high);
  EXPECT_TRUE(test::await([&] { return test::effective_level(holder) == to_native(kHigh); }))
      << "the waiter waits at the ceiling";
  may_release = true;
  high->join();
  low.join();
}

}  // namespace
}  // namespace rtpm::rt
