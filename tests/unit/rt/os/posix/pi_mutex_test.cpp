#include "rtpm/rt/pi_mutex.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

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

}  // namespace
}  // namespace rtpm::rt
