#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// Interpolates between reads of the system's clock by counting the processor's ticks, which takes
/// a third of the time of such a read. Estimates the tick rate from the reads, and relies on it
/// only when two successive estimates agree. So a counter that jumps or changes its rate (a
/// suspended machine) costs additional reads, but gives no wrong time beyond a window. Accepts
/// ticks of any fixed rate from 1 MHz to 10 GHz, and nanoseconds of the system's clock.
/// @threads  one
/// @realtime alloc-free, no syscall
class TickClock {
 public:
  /// How long one read of the clock is valid. A rate error of 20 ppm, typical of short estimates,
  /// causes an error of 20 ns in that time.
  static constexpr Duration kWindow = std::chrono::milliseconds{1};

  /// Whether the last read of the clock still covers `ticks`.
  [[nodiscard]] bool covers(std::uint64_t ticks) const noexcept {
    return ticks - anchor_ticks_ < window_ticks_;
  }
  /// The time at `ticks`, which covers() accepts. Never earlier than a time returned before.
  [[nodiscard]] std::int64_t time_at(std::uint64_t ticks) noexcept {
    return tell(anchor_ns_ + passed_ns(ticks - anchor_ticks_));
  }
  /// Records that the system's clock showed `ns`, at an unknown tick.
  [[nodiscard]] std::int64_t tell(std::int64_t ns) noexcept {
    return last_ns_ = std::max(last_ns_, ns);
  }

  /// Records that the system's clock showed `ns` at `ticks`. Returns the time, never earlier than
  /// one before.
  [[nodiscard]] std::int64_t anchor(std::uint64_t ticks, std::int64_t ns) noexcept {
    const std::int64_t time_ns = tell(ns);
    anchor_ticks_ = ticks;
    anchor_ns_ = time_ns;
    const std::int64_t since_ns = ns - base_ns_;
    // After a shorter time an estimate would be too coarse, and the current one, if any, is in
    // doubt.
    if (is_based_ && since_ns < kWindow.count() / 2 && ticks - base_ticks_ < kJump) {
      window_ticks_ = 0;
      return time_ns;
    }
    const double rate =
        is_based_ ? static_cast<double>(since_ns) / static_cast<double>(ticks - base_ticks_) : 0;
    const bool agrees = rate > kRateMin && rate < kRateMax && std::abs(rate - rate_) < rate / 4096;
    rate_ = rate;
    rate_q32_ = agrees ? static_cast<std::uint64_t>(rate * 0x1p32) : 0;
    window_ticks_ =
        agrees ? static_cast<std::uint64_t>(static_cast<double>(kWindow.count()) / rate) : 0;
    base_ticks_ = ticks;
    base_ns_ = ns;
    is_based_ = true;
    return time_ns;
  }

 private:
  static constexpr double kRateMin = 0.1;  ///< Nanoseconds per tick.
  static constexpr double kRateMax = 1000;
  /// More ticks than this in such a short time are a jump, not a rate.
  static constexpr std::uint64_t kJump = 10 * kWindow.count();

  [[nodiscard]] std::int64_t passed_ns(std::uint64_t ticks) const noexcept {
    return static_cast<std::int64_t>((ticks * rate_q32_) >> 32);
  }

  std::uint64_t anchor_ticks_ = 0;
  std::uint64_t window_ticks_ = 0;  ///< 0 if each call must read the clock.
  std::int64_t anchor_ns_ = 0;
  std::uint64_t rate_q32_ = 0;  ///< Nanoseconds per 2^32 ticks.
  std::int64_t last_ns_ = INT64_MIN;
  std::uint64_t base_ticks_ = 0;  ///< The read at which the next estimate starts.
  std::int64_t base_ns_ = 0;
  double rate_ = 0;
  bool is_based_ = false;
};

}  // namespace rtpm::rt
