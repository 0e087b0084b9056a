#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

namespace rtpm::gvd {

/// A passivity observer and controller in the time domain, axis by axis. The observer adds up the
/// energy that the device takes from its user, and a small reserve that refills with time. If the
/// device would give more than it took, the controller brakes the motion with just the damping that
/// compensates: a wall that is too stiff or too late for its loop stays bounded instead of
/// oscillating.
/// @ownership a value
/// @realtime alloc-free
/// @source   Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE
///           Transactions on Robotics and Automation 18(1), 2002
class PassivityGuard {
 public:
  /// Adds damping to `wrench`; true if it did. `motion` has what the actuators applied for
  /// `elapsed`.
  bool apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
             driver::Wrench& wrench) noexcept;
  /// Resets the guard for a force that begins anew.
  void restart() noexcept { axes_ = {}; }
  /// The lowest energy of the axes; with the reserve, the energy that may still be given.
  [[nodiscard]] double energy_joule() const noexcept;

 private:
  struct Axis {
    double energy_joule = 0;  ///< Taken less given, without the reserve.
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
