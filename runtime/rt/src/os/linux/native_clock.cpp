#include "os/native_clock.hpp"

#include <array>
#include <cerrno>
#include <ctime>

#include "file_text.hpp"
#include "rtpm/rt/native_time.hpp"
#include "tick_counter.hpp"

namespace rtpm::rt::os {

std::int64_t time_ns() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

bool counts_ticks() noexcept {
  static const bool is_used_by_kernel = [] {
    std::array<char, 32> buffer{};
    return read_file("/sys/devices/system/clocksource/clocksource0/current_clocksource", buffer) ==
           "tsc";
  }();
  return is_used_by_kernel;
}

void sleep_until(MonotonicTime time) noexcept {
  const timespec until = to_timespec(time);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

Duration thread_run_time() noexcept {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return to_duration(time);
}

}  // namespace rtpm::rt::os
