#include "rtpm/rt/pi_mutex.hpp"

#include <pthread.h>

#include <new>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"

namespace rtpm::rt {
namespace {

pthread_mutex_t* mutex_in(std::byte* storage) noexcept {
  return std::launder(reinterpret_cast<pthread_mutex_t*>(storage));
}

}  // namespace

PiMutex::PiMutex() noexcept {
  static_assert(sizeof(pthread_mutex_t) <= sizeof storage_ && alignof(pthread_mutex_t) <= 8);
  pthread_mutexattr_t attributes;
  pthread_mutexattr_init(&attributes);
  // Error-checking, because the default type silently deadlocks on misuse.
  pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_ERRORCHECK);
  const int error = pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
  RTPM_ASSERT(error == 0, "the system has mutexes with priority inheritance");
  pthread_mutex_init(new (storage_) pthread_mutex_t, &attributes);
  pthread_mutexattr_destroy(&attributes);
}

PiMutex::~PiMutex() {
  pthread_mutex_destroy(mutex_in(storage_));
}

void PiMutex::lock() noexcept {
  // Takes a free mutex without reading the clock; waiting counts as sleep.
  if (pthread_mutex_trylock(mutex_in(storage_)) == 0) return;
  const AsleepScope asleep;
  const int error = pthread_mutex_lock(mutex_in(storage_));
  RTPM_ASSERT(error == 0, "a mutex is locked once per thread");
}

bool PiMutex::try_lock() noexcept {
  return pthread_mutex_trylock(mutex_in(storage_)) == 0;
}

void PiMutex::unlock() noexcept {
  const int error = pthread_mutex_unlock(mutex_in(storage_));
  RTPM_ASSERT(error == 0, "the thread that locked a mutex unlocks it");
}

}  // namespace rtpm::rt
