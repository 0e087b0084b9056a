#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::sealed {

/// Estimates how long the frames of a session were held back in transit, without a common clock, by
/// comparing each frame with the fastest one before it.
/// @threads  one
/// @realtime alloc-free
/// @source   spec/security.md#sec-6.1
class Freshness {
 public:
  /// The possible drift between two clocks; the fastest frame's time grows by it.
  static constexpr std::int64_t kDriftDivisor = 5000;  // 200 ppm.
  static constexpr Duration kTolerance = std::chrono::milliseconds{1};
  /// After this long without a timely frame, the sender's clock is assumed to have stopped.
  static constexpr Duration kStillClock = std::chrono::seconds{10};

  /// Processes an authentic frame.
  /// @param sender_time_ns  untrusted: any number
  /// @return how much later it arrived than the fastest one; 0 if it is the fastest
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
  /// Whether no frame was timely for long: the sender's clock stopped, rather than its frames being
  /// held.
  [[nodiscard]] bool has_still_clock(MonotonicTime now) const noexcept {
    return now - in_time_at_ >= kStillClock;
  }

 private:
  bool has_frame_ = false;
  std::uint64_t fastest_ = 0;  ///< Its arrival minus its sender's time; wraps around.
  MonotonicTime fastest_at_{};
  MonotonicTime in_time_at_{};
};

}  // namespace rtpm::sealed
