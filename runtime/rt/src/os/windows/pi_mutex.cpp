#include "rtpm/rt/pi_mutex.hpp"

#include <windows.h>

#include <atomic>
#include <new>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"

namespace rtpm::rt {
namespace {

/// The system's lock, which would silently deadlock on misuse, with its owner.
struct OwnedLock {
  SRWLOCK lock = SRWLOCK_INIT;
  std::atomic<DWORD> owner{0};  ///< A thread's id; 0 if the lock is free.

  [[nodiscard]] bool is_own() const noexcept {
    return owner.load(std::memory_order_relaxed) == GetCurrentThreadId();
  }
  void note_owner() noexcept { owner.store(GetCurrentThreadId(), std::memory_order_relaxed); }
};

OwnedLock* mutex_in(std::byte* storage) noexcept {
  return std::launder(reinterpret_cast<OwnedLock*>(storage));
}

}  // namespace

PiMutex::PiMutex() noexcept {
  static_assert(sizeof(OwnedLock) <= sizeof storage_ && alignof(OwnedLock) <= 8);
  new (storage_) OwnedLock;
}

PiMutex::~PiMutex() {
  mutex_in(storage_)->~OwnedLock();
}

void PiMutex::lock() noexcept {
  // Takes a free mutex without reading the clock; waiting counts as sleep.
  if (try_lock()) return;
  OwnedLock& own = *mutex_in(storage_);
  RTPM_ASSERT(!own.is_own(), "a mutex is locked once per thread");
  const AsleepScope asleep;
  AcquireSRWLockExclusive(&own.lock);
  own.note_owner();
}

bool PiMutex::try_lock() noexcept {
  OwnedLock& own = *mutex_in(storage_);
  if (TryAcquireSRWLockExclusive(&own.lock) == 0) return false;
  own.note_owner();
  return true;
}

void PiMutex::unlock() noexcept {
  OwnedLock& own = *mutex_in(storage_);
  RTPM_ASSERT(own.is_own(), "the thread that locked a mutex unlocks it");
  own.owner.store(0, std::memory_order_relaxed);
  ReleaseSRWLockExclusive(&own.lock);
}

}  // namespace rtpm::rt
