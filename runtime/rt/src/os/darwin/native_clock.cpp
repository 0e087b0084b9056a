#include "os/native_clock.hpp"

#include <mach/mach_time.h>
#include <time.h>

#include "rtpm/rt/native_time.hpp"

// Not run yet: written from Apple's headers and manual pages.
namespace rtpm::rt::os {

// The clock that mach_wait_until() waits by; it stops while the machine sleeps.
std::int64_t time_ns() noexcept {
  return static_cast<std::int64_t>(clock_gettime_nsec_np(CLOCK_UPTIME_RAW));
}

void sleep_until(MonotonicTime time) noexcept {
  static const mach_timebase_info_data_t base = [] {
    mach_timebase_info_data_t made{};
    mach_timebase_info(&made);
    return made;
  }();
  for (std::int64_t left = 1; left > 0;) {
    left = to_ns(time) - time_ns();
    if (left <= 0) return;
    const auto ticks = static_cast<std::uint64_t>(left) * base.denom / base.numer;
    mach_wait_until(mach_absolute_time() + ticks + 1);
  }
}

Duration thread_run_time() noexcept {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return to_duration(time);
}

}  // namespace rtpm::rt::os
