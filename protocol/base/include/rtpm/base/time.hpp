#pragma once

#include <chrono>
#include <cstdint>

namespace rtpm::inline base {

/// A span of time.
using Duration = std::chrono::nanoseconds;

/// The clock of CLOCK_MONOTONIC. It has no now(): protocol code takes the time as an argument; only
/// rtpm::rt reads the clock.
struct MonotonicClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<MonotonicClock>;
  static constexpr bool is_steady = true;
};

/// A point on this host's monotonic time line.
using MonotonicTime = MonotonicClock::time_point;

/// Later than every other time.
inline constexpr MonotonicTime kNever = MonotonicTime::max();

/// `time` + `span`, at most kNever.
/// @param span  if negative, `time` is not before the clock's origin
[[nodiscard]] constexpr MonotonicTime deadline_after(Duration span, MonotonicTime time) noexcept {
  return span > Duration{0} && time > kNever - span ? kNever : time + span;
}

[[nodiscard]] constexpr std::int64_t to_ns(MonotonicTime time) noexcept {
  return time.time_since_epoch().count();
}
[[nodiscard]] constexpr MonotonicTime time_from_ns(std::int64_t ns) noexcept {
  return MonotonicTime{Duration{ns}};
}

}  // namespace rtpm::inline base
