#pragma once

#include <array>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::driver {

/// The velocity of an axis from its measured positions: the slope over as long a time as these lie
/// on a line within the measurement's resolution. So a slow motion is smooth, and a quick change is
/// followed at once.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free, at most kWindow² / 2 steps
/// @source   Janabi-Sharifi, Hayward, Chen: "Discrete-time adaptive windowing for velocity
///           estimation", IEEE Transactions on Control Systems Technology 8 (6), 2000
class VelocityFilter {
 public:
  /// Most positions that are looked back.
  static constexpr std::size_t kWindow = 16;

  /// @param resolution  step of the position, in its unit: an encoder's count
  explicit VelocityFilter(double resolution) noexcept : resolution_(resolution) {}

  /// Adds a position, and returns the velocity in its unit per second. A position that is not
  /// finite, or not newer than the last one, changes nothing.
  double add(MonotonicTime time, double position) noexcept;
  /// The newest velocity; 0 before the second position.
  [[nodiscard]] double velocity() const noexcept { return velocity_; }
  /// Forgets all positions, such as of a device that was gone.
  void reset() noexcept;

 private:
  struct Measured {
    MonotonicTime time{};
    double position = 0;
  };
  /// `age` 0: the newest.
  [[nodiscard]] const Measured& at(std::size_t age) const noexcept {
    return window_[(newest_ + kWindow - age) % kWindow];
  }
  [[nodiscard]] double slope_to(std::size_t age) const noexcept;
  /// Whether all positions in between are near the line from the newest to that one.
  [[nodiscard]] bool is_line(std::size_t age, double slope) const noexcept;

  double resolution_;
  std::array<Measured, kWindow> window_{};
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  double velocity_ = 0;
};

}  // namespace rtpm::driver
