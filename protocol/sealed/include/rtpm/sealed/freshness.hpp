#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::sealed {

/// Estimates how long the frames of one session were held back on their way, without a common
/// clock: a frame is compared with the fastest one before it.
/// @threads  one
/// @realtime alloc-free
/// @source   spec/security.md#sec-6.1
class Freshness {
 public:
  /// The possible drift between two clocks, by which the fastest frame's time grows.
  static constexpr std::int64_t kDriftDivisor = 5000;  // 200 ppm.
  static constexpr Duration kTolerance = std::chrono::milliseconds{1};
  /// After this time without a frame in time, the sender's clock is taken to have stood still.
  static constexpr Duration kStillClock = std::chrono::seconds{10};

  /// Takes an authentic frame into account.
  /// @param sender_time_ns  untrusted: any number
  /// @return how much later than the fastest one it came; 0 if it is the fastest
  Duration take(std::uint64_t sender_time_ns, MonotonicTime now) noexcept {
    const std::uint64_t sample = static_cast<std::uint64_t>(to_ns(now)) - sender_time_ns;
    const auto grown =
        static_cast<std::uint64_t>((now - fastest_at_).count() / kDriftDivisor) + fastest_;
    auto late = static_cast<std::int64_t>(sample - grown);
    if (!has_frame_ || late <= 0) {
      has_frame_ = true;
      fastest_ = sample;
      fastest_at_ = now;
      late = 0;
    }
    if (Duration{late} <= kTolerance) in_time_at_ = now;
    return Duration{late};
  }
  /// Whether no frame came in time for long: the sender's clock stopped, its frames were not held.
  [[nodiscard]] bool has_still_clock(MonotonicTime now) const noexcept {
    return now - in_time_at_ >= kStillClock;
  }

 private:
  bool has_frame_ = false;
  std::uint64_t fastest_ = 0;  ///< Its arrival less its sender's time; wraps.
  MonotonicTime fastest_at_{};
  MonotonicTime in_time_at_{};
};

}  // namespace rtpm::sealed
