#include "rtpm/rt/semaphore.hpp"

#include <chrono>
#include <new>
#include <semaphore>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"

// The standard library's: POSIX's can't wait by the monotonic clock.
namespace rtpm::rt {
namespace {

using Standard = std::counting_semaphore<>;

Standard* semaphore_in(std::byte* storage) noexcept {
  return std::launder(reinterpret_cast<Standard*>(storage));
}

}  // namespace

Semaphore::Semaphore() noexcept {
  static_assert(sizeof(Standard) <= sizeof storage_ && alignof(Standard) <= 8);
  new (storage_) Standard(0);
}

Semaphore::~Semaphore() {
  semaphore_in(storage_)->~Standard();
}

void Semaphore::post() noexcept {
  semaphore_in(storage_)->release();
}

bool Semaphore::wait_until(MonotonicTime deadline) noexcept {
  if (semaphore_in(storage_)->try_acquire()) return true;
  const AsleepScope asleep;
  if (deadline == kNever) {
    semaphore_in(storage_)->acquire();
    return true;
  }
  // The two clocks may differ, and such a wait may end early.
  for (Duration left = deadline - now(); left > Duration{0}; left = deadline - now()) {
    if (semaphore_in(storage_)->try_acquire_for(left)) return true;
  }
  return semaphore_in(storage_)->try_acquire();
}

}  // namespace rtpm::rt
