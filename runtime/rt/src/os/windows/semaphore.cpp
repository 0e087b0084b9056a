#include "rtpm/rt/semaphore.hpp"

#include <windows.h>

#include <array>
#include <atomic>
#include <climits>
#include <cstdint>
#include <new>

#include "os/native_clock.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "thread_timer.hpp"

namespace rtpm::rt {
namespace {

/// A count in front of the system's semaphore, which is used only if a thread waits. Timed waits use
/// the thread's timer: a time-out argument has steps of up to 15.6 ms.
struct CountedSemaphore {
  std::atomic<std::int64_t> count{0};  ///< Negative: how many threads wait.
  HANDLE waiters = CreateSemaphoreW(nullptr, 0, LONG_MAX, nullptr);
};

CountedSemaphore* semaphore_in(std::byte* storage) noexcept {
  return std::launder(reinterpret_cast<CountedSemaphore*>(storage));
}

bool take_if_positive(std::atomic<std::int64_t>& count) noexcept {
  std::int64_t seen = count.load(std::memory_order_relaxed);
  while (seen > 0) {
    if (count.compare_exchange_weak(seen, seen - 1)) return true;
  }
  return false;
}

/// Takes back the announcement to wait; false if a post has answered it already.
bool leave(std::atomic<std::int64_t>& count) noexcept {
  std::int64_t seen = count.load(std::memory_order_relaxed);
  while (seen < 0) {
    if (count.compare_exchange_weak(seen, seen + 1)) return true;
  }
  return false;
}

}  // namespace

Semaphore::Semaphore() noexcept {
  static_assert(sizeof(CountedSemaphore) <= sizeof storage_ && alignof(CountedSemaphore) <= 8);
  new (storage_) CountedSemaphore;
  RTPM_ASSERT(semaphore_in(storage_)->waiters != nullptr, "the system has a semaphore left");
}

Semaphore::~Semaphore() {
  CloseHandle(semaphore_in(storage_)->waiters);
  semaphore_in(storage_)->~CountedSemaphore();
}

void Semaphore::post() noexcept {
  CountedSemaphore& own = *semaphore_in(storage_);
  const HANDLE waiters = own.waiters;
  // SYNC POINT semaphore-count: without a waiter the count itself is the signal. With one, that may
  // end the semaphore only after the release below.
  if (own.count.fetch_add(1) < 0) ReleaseSemaphore(waiters, 1, nullptr);
}

bool Semaphore::wait_until(MonotonicTime deadline) noexcept {
  CountedSemaphore& own = *semaphore_in(storage_);
  if (take_if_positive(own.count)) return true;
  const AsleepScope asleep;
  // SYNC POINT semaphore-count
  if (own.count.fetch_sub(1) > 0) return true;
  if (deadline == kNever) {
    WaitForSingleObject(own.waiters, INFINITE);
    return true;
  }
  while (os::time_ns() < to_ns(deadline)) {
    const std::array<HANDLE, 2> either{own.waiters, os::timer_at(deadline)};
    if (WaitForMultipleObjects(2, either.data(), FALSE, INFINITE) == WAIT_OBJECT_0) return true;
  }
  if (leave(own.count)) return false;
  WaitForSingleObject(own.waiters, INFINITE);
  return true;
}

}  // namespace rtpm::rt
