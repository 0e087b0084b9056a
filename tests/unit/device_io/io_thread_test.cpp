#include "rtpm/device_io/io_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::test {
namespace {

const rt::ThreadConfig kTimeShared{.name = "io", .realtime = rt::RealtimeMode::kOff};

TEST(IoThread, StepsUntilItIsStopped) {
  std::atomic<int> step_count{0};
  device_io::IoThread thread;
  ASSERT_TRUE(thread.start(kTimeShared, [&] {
    ++step_count;
    return true;
  }));
  while (step_count < 3)
    std::this_thread::yield();
  thread.stop();
  const int count = step_count;
  std::this_thread::sleep_for(std::chrono::milliseconds{2});
  EXPECT_EQ(step_count, count);
}

TEST(IoThread, IsMarkedStoppedBeforeItsStepIsWoken) {
  rt::Semaphore wake;
  std::atomic<int> step_count{0};
  device_io::IoThread thread;
  ASSERT_TRUE(thread.start(kTimeShared, [&] {
    ++step_count;
    static_cast<void>(wake.wait_until(rt::now() + std::chrono::seconds{30}));
    return true;
  }));
  while (step_count < 1)
    std::this_thread::yield();
  thread.request_stop();
  wake.post();
  thread.stop();
  EXPECT_EQ(step_count, 1) << "none after it was told";
}

TEST(IoThread, EndsByItselfAndStartsAgain) {
  std::atomic<int> step_count{0};
  device_io::IoThread thread;
  for (int run = 1; run <= 2; ++run) {
    ASSERT_TRUE(thread.start(kTimeShared, [&] {
      ++step_count;
      return false;
    }));
    while (step_count < run)
      std::this_thread::yield();
    thread.stop();
    EXPECT_EQ(step_count, run);
  }
}

}  // namespace
}  // namespace rtpm::test
