#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

namespace rtpm::gvd {

/// A time-domain passivity observer and controller for each axis. The observer sums the energy that
/// the device takes from its user, plus a small reserve that refills with time. If the device would
/// give more than it took, the controller brakes the motion with just enough damping to compensate:
/// a wall that is too stiff or too delayed for its loop stays bounded instead of oscillating.
/// @ownership a value
/// @realtime alloc-free
/// @source   Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE
///           Transactions on Robotics and Automation 18(1), 2002
class PassivityGuard {
 public:
  /// Adds damping to `wrench`; true if it added any. `motion` has what the actuators applied for
  /// `elapsed`.
  bool apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
             driver::Wrench& wrench) noexcept;
  /// Resets the guard when a force starts anew.
  void restart() noexcept { axes_ = {}; }
  /// The lowest energy of all axes; adding the reserve gives the energy that may still be given.
  [[nodiscard]] double energy_joule() const noexcept;

 private:
  struct Axis {
    double energy_joule = 0;  ///< Energy taken minus energy given, without the reserve.
  };
  bool guard(const SafetyConfig& config, double elapsed_s, double applied_newton,
             double velocity_m_per_s, Axis& axis, double& force_newton) noexcept;

  struct Axes {
    Axis x{};
    Axis y{};
    Axis z{};
  };
  Axes axes_{};
};

}  // namespace rtpm::gvd
