#include "rtpm/rt/semaphore.hpp"

#include <cerrno>
#include <ctime>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::rt {

Semaphore::Semaphore() noexcept {
  sem_init(&semaphore_, /*pshared=*/0, 0);
}

Semaphore::~Semaphore() {
  sem_destroy(&semaphore_);
}

void Semaphore::post() noexcept {
  const int error = sem_post(&semaphore_);
  RTPM_ASSERT(error == 0, "a semaphore is waited for as often as it is posted");
}

bool Semaphore::wait_until(MonotonicTime deadline) noexcept {
  // If the count is above 0, there is no sleep.
  if (sem_trywait(&semaphore_) == 0) return true;
  const AsleepScope asleep;
  if (deadline == kNever) {
    while (sem_wait(&semaphore_) != 0) {
    }
    return true;
  }
  const timespec until = to_timespec(deadline);
  int result = 0;
  do {
    result = sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

}  // namespace rtpm::rt
