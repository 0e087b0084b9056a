#pragma once

#include <array>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::driver {

/// Estimates the velocity of an axis from its measured positions: the slope over the longest time
/// in which the positions lie on a line, within the resolution. So slow motion gives a smooth
/// velocity, and quick changes show at once.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free, at most kWindow² / 2 steps
/// @source   Janabi-Sharifi, Hayward, Chen: "Discrete-time adaptive windowing for velocity
///           estimation", IEEE Transactions on Control Systems Technology 8 (6), 2000
class VelocityFilter {
 public:
  /// Maximum number of positions in the window.
  static constexpr std::size_t kWindow = 16;

  /// @param resolution  step of the position, in its unit: an encoder's count
  explicit VelocityFilter(double resolution) noexcept : resolution_(resolution) {}

  /// Adds a position, and returns the velocity in its unit per second. A position that is not
  /// finite, or not newer than the last one, changes nothing.
  double add(MonotonicTime time, double position) noexcept;
  /// The newest velocity; 0 before the second position.
  [[nodiscard]] double velocity() const noexcept { return velocity_; }
  /// Discards all positions, for example after the device was gone.
  void reset() noexcept;

 private:
  struct Measured {
    MonotonicTime time{};
    double position = 0;
  };
  /// The measurement `age` steps before the newest.
  [[nodiscard]] const Measured& at(std::size_t age) const noexcept {
    return window_[(newest_ + kWindow - age) % kWindow];
  }
  [[nodiscard]] double slope_to(std::size_t age) const noexcept;
  /// Whether all positions in between are close to the line from the newest position to that of
  /// `age`.
  [[nodiscard]] bool is_line(std::size_t age, double slope) const noexcept;

  double resolution_;
  std::array<Measured, kWindow> window_{};
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  double velocity_ = 0;
};

}  // namespace rtpm::driver
