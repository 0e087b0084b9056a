#include "rtpm/test/lock_guard.hpp"

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <string_view>

#include "breaches.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::test {
namespace {

Breaches breaches;

#ifndef RTPM_TEST_HAS_SANITIZER

constexpr std::string_view kCrime =
    " was called by a real-time thread for a lock without priority inheritance";

// The protocol is in the mutex's kind, where the C library keeps it; no function returns it.
bool inherits_priority(const pthread_mutex_t& mutex) noexcept {
  constexpr int kInherit = 32;
  constexpr int kProtect = 64;
  return (mutex.__data.__kind & (kInherit | kProtect)) != 0;
}

void check(const pthread_mutex_t& mutex, std::string_view function) noexcept {
  if (rt::is_allocation_forbidden() && !inherits_priority(mutex)) breaches.add(function, kCrime);
}

// The C library's own function, which the one here replaces.
template <class Function>
Function* original(std::atomic<Function*>& known, const char* name) noexcept {
  Function* function = known.load(std::memory_order_acquire);
  if (function != nullptr) return function;
  function = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  known.store(function, std::memory_order_release);
  return function;
}

using Lock = int(pthread_mutex_t*);
using ClockLock = int(pthread_mutex_t*, clockid_t, const timespec*);
using ReadWriteLock = int(pthread_rwlock_t*);
std::atomic<Lock*> real_lock{nullptr};
std::atomic<Lock*> real_trylock{nullptr};
std::atomic<ClockLock*> real_clocklock{nullptr};
std::atomic<ReadWriteLock*> real_read_lock{nullptr};
std::atomic<ReadWriteLock*> real_write_lock{nullptr};

#endif

}  // namespace

bool is_lock_guard_active() noexcept {
#ifdef RTPM_TEST_HAS_SANITIZER
  return false;
#else
  return true;
#endif
}

std::uint64_t lock_breach_count() noexcept {
  return breaches.count();
}

CountLockBreachesOnly::CountLockBreachesOnly() noexcept {
  breaches.begin_counting_only();
}

CountLockBreachesOnly::~CountLockBreachesOnly() {
  breaches.end_counting_only();
}

}  // namespace rtpm::test

#ifndef RTPM_TEST_HAS_SANITIZER

// NOLINTBEGIN(readability-inconsistent-declaration-parameter-name)
extern "C" {

int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  rtpm::test::check(*mutex, "pthread_mutex_lock");
  return rtpm::test::original(rtpm::test::real_lock, "pthread_mutex_lock")(mutex);
}

int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept {
  rtpm::test::check(*mutex, "pthread_mutex_trylock");
  return rtpm::test::original(rtpm::test::real_trylock, "pthread_mutex_trylock")(mutex);
}

int pthread_mutex_clocklock(pthread_mutex_t* mutex, clockid_t clock,
                            const timespec* until) noexcept {
  rtpm::test::check(*mutex, "pthread_mutex_clocklock");
  return rtpm::test::original(rtpm::test::real_clocklock, "pthread_mutex_clocklock")(mutex, clock,
                                                                                     until);
}

int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  if (rtpm::rt::is_allocation_forbidden())
    rtpm::test::breaches.add("pthread_rwlock_rdlock", rtpm::test::kCrime);
  return rtpm::test::original(rtpm::test::real_read_lock, "pthread_rwlock_rdlock")(lock);
}

int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  if (rtpm::rt::is_allocation_forbidden())
    rtpm::test::breaches.add("pthread_rwlock_wrlock", rtpm::test::kCrime);
  return rtpm::test::original(rtpm::test::real_write_lock, "pthread_rwlock_wrlock")(lock);
}

}  // extern "C"
// NOLINTEND(readability-inconsistent-declaration-parameter-name)

#endif
