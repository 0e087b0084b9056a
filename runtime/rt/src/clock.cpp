#include "rtpm/rt/clock.hpp"

#include <cerrno>
#include <ctime>

#include "rtpm/rt/budget.hpp"

namespace rtpm::rt {

MonotonicTime now() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time_from_ns(std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec);
}

void sleep_until(MonotonicTime time) noexcept {
  const AsleepScope asleep;
  timespec until{};
  until.tv_sec = to_ns(time) / 1'000'000'000;
  until.tv_nsec = to_ns(time) % 1'000'000'000;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace rtpm::rt
