#include "rtpm/test/lock_guard.hpp"

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <mutex>
#include <shared_mutex>
#include <thread>

#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::test {
namespace {

class LockGuard : public testing::Test {
 protected:
  void SetUp() override {
    if (!is_lock_guard_active()) GTEST_SKIP() << kLockGuardInactive;
  }
};
using LockGuardDeathTest = LockGuard;

/// The breaches that `action` causes inside a scope of this thread.
template <class Action>
std::uint64_t breaches_of(Action action) {
  const CountLockBreachesOnly count_only;
  const std::uint64_t before = lock_breach_count();
  {
    const rt::NoAllocationScope scope;
    action();
  }
  return lock_breach_count() - before;
}

TEST_F(LockGuard, SeesEveryWayToTakeALockWithoutInheritance) {
  std::mutex mutex;
  std::timed_mutex timed;
  std::recursive_mutex recursive;
  std::shared_mutex shared;
  EXPECT_EQ(breaches_of([&] { const std::lock_guard lock(mutex); }), 1u);
  EXPECT_EQ(breaches_of([&] {
              if (mutex.try_lock()) mutex.unlock();
            }),
            1u);
  EXPECT_EQ(breaches_of([&] {
              if (timed.try_lock_for(std::chrono::milliseconds{1})) timed.unlock();
            }),
            1u);
  EXPECT_EQ(breaches_of([&] { const std::lock_guard lock(recursive); }), 1u);
  EXPECT_EQ(breaches_of([&] { const std::lock_guard lock(shared); }), 1u);
  EXPECT_EQ(breaches_of([&] { const std::shared_lock lock(shared); }), 1u);
}

TEST_F(LockGuard, LetsLocksWithInheritancePass) {
  rt::PiMutex inheriting;
  EXPECT_EQ(breaches_of([&] {
              { const std::lock_guard lock(inheriting); }
              if (inheriting.try_lock()) inheriting.unlock();
            }),
            0u);
}

TEST_F(LockGuard, ForbidsForTheThreadOfTheScopeAlone) {
  const std::uint64_t before = lock_breach_count();
  std::mutex mutex;
  const rt::NoAllocationScope scope;
  const rt::AllowAllocationScope for_the_thread;
  std::thread([&] { const std::lock_guard lock(mutex); }).join();
  EXPECT_EQ(lock_breach_count(), before);
}

TEST_F(LockGuardDeathTest, EndsTheProgramWithTheStack) {
  EXPECT_EXIT(
      {
        std::mutex mutex;
        const rt::NoAllocationScope scope;
        mutex.lock();
      },
      testing::KilledBySignal(SIGABRT), "for a lock without priority inheritance; its stack");
}

}  // namespace
}  // namespace rtpm::test
