#include "rtpm/rt/clock.hpp"

#include <algorithm>
#include <cstdint>

#include "os/native_clock.hpp"
#include "rtpm/rt/budget.hpp"
#include "tick_clock.hpp"
#include "tick_counter.hpp"

namespace rtpm::rt {
namespace {

constinit thread_local TickClock thread_clock;
// The most ticks that a read of the system's clock takes without an interrupt.
constinit thread_local std::uint64_t look_ticks_max = 256;

// Reads the system's clock, and the ticks just before and after.
[[gnu::noinline]] std::int64_t look() noexcept {
  if (!os::counts_ticks()) return os::time_ns();
  constexpr int kTryCount = 3;
  std::int64_t time_ns = 0;
  for (int i = 0; i < kTryCount; ++i) {
    const std::uint64_t before = os::ticks();
    time_ns = os::time_ns();
    const std::uint64_t passed = os::ticks() - before;
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
  if constexpr (!os::kMayCountTicks) return os::time_ns();
  const std::uint64_t count = os::ticks();
  return thread_clock.covers(count) ? thread_clock.time_at(count) : look();
}

}  // namespace

MonotonicTime now() noexcept {
  return time_from_ns(time_now_ns());
}

void sleep_until(MonotonicTime time) noexcept {
  const AsleepScope asleep;
  os::sleep_until(time);
}

}  // namespace rtpm::rt
