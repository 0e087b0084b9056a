#include "rtpm/rt/semaphore.hpp"

#include <semaphore.h>

#include <cerrno>
#include <ctime>
#include <new>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::rt {
namespace {

sem_t* semaphore_in(std::byte* storage) noexcept {
  return std::launder(reinterpret_cast<sem_t*>(storage));
}

}  // namespace

Semaphore::Semaphore() noexcept {
  static_assert(sizeof(sem_t) <= sizeof storage_ && alignof(sem_t) <= 8);
  sem_init(new (storage_) sem_t, /*pshared=*/0, 0);
}

Semaphore::~Semaphore() {
  sem_destroy(semaphore_in(storage_));
}

void Semaphore::post() noexcept {
  const int error = sem_post(semaphore_in(storage_));
  RTPM_ASSERT(error == 0, "a semaphore is waited for as often as it is posted");
}

bool Semaphore::wait_until(MonotonicTime deadline) noexcept {
  // If the count is above 0, there is no sleep.
  if (sem_trywait(semaphore_in(storage_)) == 0) return true;
  const AsleepScope asleep;
  if (deadline == kNever) {
    while (sem_wait(semaphore_in(storage_)) != 0) {
    }
    return true;
  }
  const timespec until = to_timespec(deadline);
  int result = 0;
  do {
    result = sem_clockwait(semaphore_in(storage_), CLOCK_MONOTONIC, &until);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

}  // namespace rtpm::rt
