#include <algorithm>
#include <chrono>

#include "rtpm/models/check.hpp"

namespace rtpm::gvd {
namespace {

/// The average age of a position while its force acts, in periods: it is one period old when the
/// force acts; the force is then held for one period, half a period on average.
constexpr double kDelayPeriods = 1.5;
constexpr double kFullEffortRad = 0.02;
constexpr double kFullEffortRadPerS = 1;
constexpr double kFullEffortPeriodS = 0.001;

bool takes(const driver::Descriptor& descriptor, driver::CommandMode mode) noexcept {
  return std::ranges::find(descriptor.modes, mode) != descriptor.modes.end();
}

}  // namespace

ModelLimits ModelLimits::for_device(const driver::Descriptor& descriptor,
                                    Duration period) noexcept {
  const double period_s = std::chrono::duration<double>(period).count();
  const double device_period_s = 1 / std::max(descriptor.rate_hz, 1.0);
  const driver::Limits& of_device = descriptor.limits;
  ModelLimits limits;
  if (takes(descriptor, driver::CommandMode::kForce) && of_device.force_newton_max > 0) {
    const double damping =
        of_device.damping_newton_s_per_m > 0
            ? of_device.damping_newton_s_per_m
            : kDelayPeriods * device_period_s * of_device.stiffness_newton_per_m_max;
    const double stiffness = damping / (kDelayPeriods * period_s);
    limits.force_newton_max = of_device.force_newton_max;
    limits.damping_newton_s_per_m_max = damping;
    limits.stiffness_newton_per_m_max =
        of_device.stiffness_newton_per_m_max > 0
            ? std::min(stiffness, of_device.stiffness_newton_per_m_max)
            : stiffness;
  }
  if (!takes(descriptor, driver::CommandMode::kJointEffort)) return limits;
  const std::size_t count = std::min(descriptor.joints.size(), driver::kJointCountMax);
  for (std::size_t i = 0; i < count; ++i) {
    const driver::Joint& joint = descriptor.joints[i];
    if (joint.unit != "rad") continue;
    const double angle_rad = kFullEffortRad * std::max(1.0, period_s / kFullEffortPeriodS);
    limits.efforts_newton_metre_max[i] = joint.effort_max;
    limits.stiffness_newton_metre_per_rad_max[i] = joint.effort_max / angle_rad;
    limits.damping_newton_metre_s_per_rad_max[i] = joint.effort_max / kFullEffortRadPerS;
  }
  return limits;
}

}  // namespace rtpm::gvd
