#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

/// The limits of a command, one class each. All are values without clock, thread or heap; times and
/// motions are arguments. @realtime alloc-free, all of them
namespace rtpm::gvd {

/// Latches when a command has a NaN or an infinity: no force until recover(), even if later
/// commands are valid.
class NotFiniteLatch {
 public:
  /// True if this command sets the latch.
  bool take(const driver::Wrench& wrench) noexcept;
  void recover() noexcept { is_set_ = false; }
  [[nodiscard]] bool is_set() const noexcept { return is_set_; }

 private:
  bool is_set_ = false;
};

/// Limits force and torque to their maximum magnitude, keeping directions.
class Clamp {
 public:
  /// True if force or torque was above its maximum.
  static bool apply(const SafetyConfig& config, driver::Wrench& wrench) noexcept;
};

/// The applied share of the command rises from 0 to 1 while commands last for
/// SafetyConfig::soft_start.
class SoftStart {
 public:
  /// Scales `wrench`; true while the share is below one.
  bool apply(const SafetyConfig& config, Duration elapsed, driver::Wrench& wrench) noexcept;
  /// Reduces the share with a falling force, so that a returning command continues from there.
  void fall(double by) noexcept { share_ *= by; }
  void restart() noexcept { share_ = 0; }
  [[nodiscard]] double share() const noexcept { return share_; }

 private:
  double share_ = 0;
};

/// Moves the output towards the requested wrench, no faster than the maximum rates of change.
class RateLimit {
 public:
  /// True if `output` did not reach the requested wrench.
  static bool approach(const SafetyConfig& config, Duration elapsed, const driver::Wrench& wanted,
                       driver::Wrench& output) noexcept;
};

/// Reduces a force that would give the user more power than SafetyConfig::power_watt_max. A braking
/// force takes power and is not limited.
class PowerLimit {
 public:
  /// True if the force was reduced.
  static bool apply(const SafetyConfig& config, const Motion& motion,
                    driver::Wrench& wrench) noexcept;
};

/// Latches when the device moves faster than SafetyConfig::velocity_m_per_s_max: no force until
/// recover().
class VelocityTrip {
 public:
  /// True if this motion sets the latch.
  bool take(const SafetyConfig& config, const Motion& motion) noexcept;
  void recover() noexcept { is_set_ = false; }
  [[nodiscard]] bool is_set() const noexcept { return is_set_; }

 private:
  bool is_set_ = false;
};

/// Acts outside the workspace, for each axis: removes any force that pushes further out, and adds a
/// damped spring that pushes back with at most half of the maximum force. It never pulls.
class SoftWall {
 public:
  /// True if the position is outside.
  static bool apply(const SafetyConfig& config, const Motion& motion,
                    driver::Wrench& wrench) noexcept;
};

/// Models the motors' heat by the square of the force: above SafetyConfig::force_newton_continuous
/// it fills a store, which force_newton_max fills in heat_time. Once the store is half full, the
/// limit falls from the maximum towards the continuous force.
/// @source   I²t protection of motor drives
class HeatLimit {
 public:
  /// True if `wrench` was reduced. `motion` has what the motors applied for `elapsed`.
  bool apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
             driver::Wrench& wrench) noexcept;
  /// How full the store is: 0 is cold, 1 is full.
  [[nodiscard]] double fill() const noexcept { return fill_; }

 private:
  double fill_ = 0;
};

}  // namespace rtpm::gvd
