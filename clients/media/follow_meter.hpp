#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/histogram.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::media {

/// Measures the time from a commanded target until the player shows it. Targets for which the
/// player went straight to newer ones count as skipped.
/// @ownership about 16 KiB; do not put it on a stack
/// @threads  one at a time
/// @realtime alloc-free
class FollowMeter {
 public:
  /// Records a commanded position; ignores one equal to the last.
  void command(double target_s, MonotonicTime now) noexcept;
  /// Records a position that the player shows.
  void show(double position_s, double frame_s, MonotonicTime now) noexcept;

  [[nodiscard]] const LatencyHistogram& followed() const noexcept { return followed_; }
  [[nodiscard]] std::uint64_t target_count() const noexcept { return target_count_; }
  /// How far the player moved forwards while following.
  [[nodiscard]] double forwards_s() const noexcept { return forwards_s_; }
  [[nodiscard]] double backwards_s() const noexcept { return backwards_s_; }

 private:
  struct Target {
    double position_s = -1;
    MonotonicTime commanded{};
  };
  static constexpr std::size_t kTargetCountMax = 64;

  std::array<Target, kTargetCountMax> targets_{};
  std::uint64_t target_count_ = 0;
  std::uint64_t done_count_ = 0;  ///< Targets that were shown or skipped.
  double last_target_s_ = -1;
  double shown_s_ = -1;
  double forwards_s_ = 0;
  double backwards_s_ = 0;
  LatencyHistogram followed_{};
};

}  // namespace rtpm::media
