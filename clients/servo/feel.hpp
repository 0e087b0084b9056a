#pragma once

#include <algorithm>

#include "god_object.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/driver/vector.hpp"

namespace rtpm::servo {

/// Estimates the wall stiffness that a hand feels: the applied force over the measured depth.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free
class Feel {
 public:
  /// Ignores samples outside the wall and during soft start.
  void record(const scene::Touch& touch, const driver::Sample& sample) noexcept {
    if (touch.depth_m <= 0 || sample.faults.has(driver::Fault::kSoftStart)) return;
    force_by_depth_ +=
        dot(sample.wrench_applied.force_newton, difference(touch.proxy_m, touch.device_m));
    depth_square_ += touch.depth_m * touch.depth_m;
    depth_m_max_ = std::max(depth_m_max_, touch.depth_m);
  }

  /// The slope of the line through 0 that best fits force over depth by least squares, in N/m; 0
  /// without contact.
  [[nodiscard]] double stiffness_newton_per_m() const noexcept {
    return depth_square_ > 0 ? force_by_depth_ / depth_square_ : 0;
  }
  [[nodiscard]] double depth_m_max() const noexcept { return depth_m_max_; }

 private:
  double force_by_depth_ = 0;  ///< The sum, in N·m.
  double depth_square_ = 0;    ///< The sum, in m².
  double depth_m_max_ = 0;
};

}  // namespace rtpm::servo
