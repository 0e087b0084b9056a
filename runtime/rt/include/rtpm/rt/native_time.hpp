#pragma once

#include <ctime>

#include "rtpm/base/time.hpp"

/// Converts between RTPM's times and the operating system's.
namespace rtpm::rt {

/// `duration` must not be negative.
/// @realtime alloc-free
[[nodiscard]] constexpr timespec to_timespec(Duration duration) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  // Some systems' `long` has 32 bits.
  return {.tv_sec = duration.count() / kSecond,
          .tv_nsec = static_cast<long>(duration.count() % kSecond)};
}

/// A time on CLOCK_MONOTONIC.
/// @realtime alloc-free
[[nodiscard]] constexpr timespec to_timespec(MonotonicTime time) noexcept {
  return to_timespec(time.time_since_epoch());
}

/// A clock's reading, as the time since its epoch.
/// @realtime alloc-free
[[nodiscard]] constexpr Duration to_duration(const timespec& time) noexcept {
  return std::chrono::seconds{time.tv_sec} + std::chrono::nanoseconds{time.tv_nsec};
}

}  // namespace rtpm::rt
