#include "rtpm/safety/limits.hpp"

#include <algorithm>
#include <cmath>

#include "rtpm/safety/finite.hpp"
#include "vector.hpp"

namespace rtpm::gvd {
namespace {

using driver::Vector3;

/// The fill level above which the heat limit drops below the maximum.
constexpr double kWarmFill = 0.5;

/// Moves `from` towards `to` by at most `way_max`; true if it did not get there.
bool move_towards(Vector3& from, const Vector3& to, double way_max) noexcept {
  Vector3 way = difference(to, from);
  const bool is_limited = shorten(way, way_max);
  from = is_limited ? sum(from, way) : to;
  return is_limited;
}

/// One axis of the soft wall; true if `position_m` is outside.
bool push_back(const SafetyConfig& config, double low_m, double high_m, double position_m,
               double velocity_m_per_s, double& force_newton) noexcept {
  if (low_m >= high_m || (position_m >= low_m && position_m <= high_m)) return false;
  // Inwards is positive.
  const double inwards = position_m < low_m ? 1 : -1;
  const double depth_m = position_m < low_m ? low_m - position_m : position_m - high_m;
  const double wanted = inwards * force_newton;
  const double push =
      config.wall_newton_per_m * depth_m - config.wall_newton_s_per_m * velocity_m_per_s * inwards;
  const double wall = std::clamp(push, 0.0, config.force_newton_max / 2);
  force_newton = inwards * (std::max(wanted, 0.0) + wall);
  return true;
}

}  // namespace

bool NotFiniteLatch::take(const driver::Wrench& wrench) noexcept {
  if (is_set_ || is_finite(wrench)) return false;
  is_set_ = true;
  return true;
}

bool Clamp::apply(const SafetyConfig& config, driver::Wrench& wrench) noexcept {
  const bool is_force_clamped = shorten(wrench.force_newton, config.force_newton_max);
  const bool is_torque_clamped =
      shorten(wrench.torque_newton_metre, config.torque_newton_metre_max);
  return is_force_clamped || is_torque_clamped;
}

bool SoftStart::apply(const SafetyConfig& config, Duration elapsed,
                      driver::Wrench& wrench) noexcept {
  share_ = config.soft_start > Duration{0}
               ? std::min(1.0, share_ + seconds(elapsed) / seconds(config.soft_start))
               : 1.0;
  wrench = scaled(wrench, share_);
  return share_ < 1.0;
}

bool RateLimit::approach(const SafetyConfig& config, Duration elapsed, const driver::Wrench& wanted,
                         driver::Wrench& output) noexcept {
  const double elapsed_s = seconds(elapsed);
  const bool is_force_limited = move_towards(output.force_newton, wanted.force_newton,
                                             config.force_newton_per_s_max * elapsed_s);
  const bool is_torque_limited =
      move_towards(output.torque_newton_metre, wanted.torque_newton_metre,
                   config.torque_newton_metre_per_s_max * elapsed_s);
  return is_force_limited || is_torque_limited;
}

bool PowerLimit::apply(const SafetyConfig& config, const Motion& motion,
                       driver::Wrench& wrench) noexcept {
  if (config.power_watt_max <= 0) return false;
  const double power_watt = dot(wrench.force_newton, motion.twist.linear_m_per_s) +
                            dot(wrench.torque_newton_metre, motion.twist.angular_rad_per_s);
  if (!(power_watt > config.power_watt_max)) return false;
  wrench = scaled(wrench, config.power_watt_max / power_watt);
  return true;
}

bool VelocityTrip::take(const SafetyConfig& config, const Motion& motion) noexcept {
  if (is_set_ || config.velocity_m_per_s_max <= 0 ||
      length(motion.twist.linear_m_per_s) <= config.velocity_m_per_s_max) {
    return false;
  }
  is_set_ = true;
  return true;
}

bool SoftWall::apply(const SafetyConfig& config, const Motion& motion,
                     driver::Wrench& wrench) noexcept {
  if (config.wall_newton_per_m <= 0) return false;
  const Vector3& low_m = config.workspace.low_m;
  const Vector3& high_m = config.workspace.high_m;
  const Vector3& at_m = motion.position_m;
  const Vector3& velocity = motion.twist.linear_m_per_s;
  Vector3& force = wrench.force_newton;
  const bool is_x = push_back(config, low_m.x, high_m.x, at_m.x, velocity.x, force.x);
  const bool is_y = push_back(config, low_m.y, high_m.y, at_m.y, velocity.y, force.y);
  const bool is_z = push_back(config, low_m.z, high_m.z, at_m.z, velocity.z, force.z);
  return is_x || is_y || is_z;
}

bool HeatLimit::apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
                      driver::Wrench& wrench) noexcept {
  const double endless = config.force_newton_continuous;
  const double greatest = config.force_newton_max;
  if (endless <= 0 || endless >= greatest || config.heat_time <= Duration{0}) return false;
  const double applied = std::min(length(motion.wrench_applied.force_newton), greatest);
  const double store = (greatest * greatest - endless * endless) * seconds(config.heat_time);
  const double gain = (applied * applied - endless * endless) * seconds(elapsed);
  fill_ = std::clamp(fill_ + gain / store, 0.0, 1.0);
  const double share = std::clamp((1 - fill_) / (1 - kWarmFill), 0.0, 1.0);
  return shorten(wrench.force_newton, endless + share * (greatest - endless));
}

}  // namespace rtpm::gvd
