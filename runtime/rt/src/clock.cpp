#include "rtpm/rt/clock.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

#include "file_text.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/native_time.hpp"
#include "tick_clock.hpp"

namespace rtpm::rt {
namespace {

std::int64_t system_time_ns() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

#if defined(__x86_64__)

constinit thread_local TickClock thread_clock;
// The most ticks that a read of the system's clock takes without an interrupt.
constinit thread_local std::uint64_t look_ticks_max = 256;

std::uint64_t ticks() noexcept {
  return __builtin_ia32_rdtsc();
}

// The kernel uses the tick counter as its clock only if its rate is constant, it never stops, and
// it is the same on all CPUs.
bool is_ticking() noexcept {
  static const bool is_used_by_kernel = [] {
    std::array<char, 32> buffer{};
    return read_file("/sys/devices/system/clocksource/clocksource0/current_clocksource", buffer) ==
           "tsc";
  }();
  return is_used_by_kernel;
}

// Reads the system's clock, and the ticks just before and after.
[[gnu::noinline]] std::int64_t look() noexcept {
  if (!is_ticking()) return system_time_ns();
  constexpr int kTryCount = 3;
  std::int64_t time_ns = 0;
  for (int i = 0; i < kTryCount; ++i) {
    const std::uint64_t before = ticks();
    time_ns = system_time_ns();
    const std::uint64_t passed = ticks() - before;
    if (passed <= look_ticks_max) {
      look_ticks_max = std::min(look_ticks_max, 2 * passed);
      return thread_clock.anchor(before + passed / 2, time_ns);
    }
    // The machine may simply be slow.
    look_ticks_max += look_ticks_max / 8;
  }
  return thread_clock.tell(time_ns);
}

std::int64_t time_now_ns() noexcept {
  const std::uint64_t count = ticks();
  return thread_clock.covers(count) ? thread_clock.time_at(count) : look();
}

#else

std::int64_t time_now_ns() noexcept {
  return system_time_ns();
}

#endif

}  // namespace

MonotonicTime now() noexcept {
  return time_from_ns(time_now_ns());
}

void sleep_until(MonotonicTime time) noexcept {
  const AsleepScope asleep;
  const timespec until = to_timespec(time);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace rtpm::rt
