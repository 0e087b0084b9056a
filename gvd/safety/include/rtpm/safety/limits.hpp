#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

/// The limits of a command, one class each. All are values without clock, thread and heap; times
/// and motions are arguments. @realtime alloc-free, all of them
namespace rtpm::gvd {

/// A NaN or an infinity in a command: no force until recover(), however good later commands are.
class NotFiniteLatch {
 public:
  /// True when this command sets it.
  bool take(const driver::Wrench& wrench) noexcept;
  void recover() noexcept { is_set_ = false; }
  [[nodiscard]] bool is_set() const noexcept { return is_set_; }

 private:
  bool is_set_ = false;
};

/// Shortens force and torque to their maximum magnitude; directions stay.
class Clamp {
 public:
  /// True if force or torque was too long.
  static bool apply(const SafetyConfig& config, driver::Wrench& wrench) noexcept;
};

/// The share of the command that is applied rises from nothing to all over SafetyConfig::soft_start
/// of commands.
class SoftStart {
 public:
  /// Scales `wrench`; true while the share is below one.
  bool apply(const SafetyConfig& config, Duration elapsed, driver::Wrench& wrench) noexcept;
  /// Shrinks the share with a falling force, so that a command that comes back goes on from there.
  void fall(double by) noexcept { share_ *= by; }
  void restart() noexcept { share_ = 0; }
  [[nodiscard]] double share() const noexcept { return share_; }

 private:
  double share_ = 0;
};

/// Moves the output towards the wanted wrench, no faster than the maximum rates of change.
class RateLimit {
 public:
  /// True if `output` did not reach the wanted wrench.
  static bool approach(const SafetyConfig& config, Duration elapsed, const driver::Wrench& wanted,
                       driver::Wrench& output) noexcept;
};

/// Shortens a force that would give its user more than SafetyConfig::power_watt_max. A force that
/// brakes takes power, and is left alone.
class PowerLimit {
 public:
  /// True if it was shortened.
  static bool apply(const SafetyConfig& config, const Motion& motion,
                    driver::Wrench& wrench) noexcept;
};

/// The device moves faster than SafetyConfig::velocity_m_per_s_max: no force until recover().
class VelocityTrip {
 public:
  /// True when this motion sets it.
  bool take(const SafetyConfig& config, const Motion& motion) noexcept;
  void recover() noexcept { is_set_ = false; }
  [[nodiscard]] bool is_set() const noexcept { return is_set_; }

 private:
  bool is_set_ = false;
};

/// Outside of the workspace, axis by axis: removes any force that pushes further out, and adds a
/// spring with a damper that pushes back, with at most half of the maximum force. It never pulls.
class SoftWall {
 public:
  /// True if the position is outside.
  static bool apply(const SafetyConfig& config, const Motion& motion,
                    driver::Wrench& wrench) noexcept;
};

/// The motors' heat, by the square of the force: above SafetyConfig::force_newton_continuous it
/// fills a store that force_newton_max fills in heat_time; from half full on, the limit falls from
/// the maximum to the continuous force.
/// @source   I²t protection of motor drives
class HeatLimit {
 public:
  /// True if `wrench` was shortened. `motion` has what the motors applied for `elapsed`.
  bool apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
             driver::Wrench& wrench) noexcept;
  /// 0 cold, 1 full.
  [[nodiscard]] double fill() const noexcept { return fill_; }

 private:
  double fill_ = 0;
};

}  // namespace rtpm::gvd
