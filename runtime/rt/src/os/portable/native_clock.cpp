#include "os/native_clock.hpp"

#include <ctime>

#include "rtpm/rt/native_time.hpp"

namespace rtpm::rt::os {
namespace {

Duration read_clock(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return to_duration(time);
}

}  // namespace

std::int64_t time_ns() noexcept {
  return read_clock(CLOCK_MONOTONIC).count();
}

// A sleep can be relative only (POSIX's clock_nanosleep is an option), so it is repeated.
void sleep_until(MonotonicTime time) noexcept {
  for (;;) {
    const Duration left = time - time_from_ns(time_ns());
    if (left <= Duration{0}) return;
    const timespec pause = to_timespec(left);
    nanosleep(&pause, nullptr);
  }
}

Duration thread_run_time() noexcept {
  return read_clock(CLOCK_THREAD_CPUTIME_ID);
}

}  // namespace rtpm::rt::os
