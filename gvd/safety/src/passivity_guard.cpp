#include "rtpm/safety/passivity_guard.hpp"

#include <algorithm>
#include <cmath>

#include "vector.hpp"

namespace rtpm::gvd {
namespace {

/// Below this velocity damping takes too little energy to matter.
constexpr double kVelocityMin = 1e-4;

}  // namespace

bool PassivityGuard::apply(const SafetyConfig& config, Duration elapsed, const Motion& motion,
                           driver::Wrench& wrench) noexcept {
  if (!config.has_passivity_guard || elapsed <= Duration{0}) return false;
  const double elapsed_s = seconds(elapsed);
  const driver::Vector3& applied = motion.wrench_applied.force_newton;
  const driver::Vector3& velocity = motion.twist.linear_m_per_s;
  driver::Vector3& force = wrench.force_newton;
  const bool is_x = guard(config, elapsed_s, applied.x, velocity.x, axes_.x, force.x);
  const bool is_y = guard(config, elapsed_s, applied.y, velocity.y, axes_.y, force.y);
  const bool is_z = guard(config, elapsed_s, applied.z, velocity.z, axes_.z, force.z);
  return is_x || is_y || is_z;
}

bool PassivityGuard::guard(const SafetyConfig& config, double elapsed_s, double applied_newton,
                           double velocity_m_per_s, Axis& axis, double& force_newton) noexcept {
  // Observer: adds the energy that the last force took, and the refill, which never exceeds the
  // energy that was given.
  axis.energy_joule = std::min(axis.energy_joule - applied_newton * velocity_m_per_s * elapsed_s,
                               config.passivity_store_joule);
  if (axis.energy_joule < 0) {
    axis.energy_joule = std::min(0.0, axis.energy_joule + config.passivity_watt * elapsed_s);
  }
  // Controller: predicts the energy that the requested force gives by the next cycle at the same
  // velocity.
  const double after_joule = axis.energy_joule + config.passivity_reserve_joule -
                             force_newton * velocity_m_per_s * elapsed_s;
  if (after_joule >= 0 || std::abs(velocity_m_per_s) < kVelocityMin) return false;
  const double damping = std::min(-after_joule / (velocity_m_per_s * velocity_m_per_s * elapsed_s),
                                  config.passivity_newton_s_per_m_max);
  force_newton -= damping * velocity_m_per_s;
  return damping > 0;
}

double PassivityGuard::energy_joule() const noexcept {
  return std::min({axes_.x.energy_joule, axes_.y.energy_joule, axes_.z.energy_joule});
}

}  // namespace rtpm::gvd
