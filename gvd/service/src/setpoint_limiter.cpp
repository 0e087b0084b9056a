#include "rtpm/gvd/setpoint_limiter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rtpm/driver/vector.hpp"
#include "rtpm/safety/finite.hpp"

namespace rtpm::gvd {
namespace {

using driver::CommandMode;
using driver::Vector3;

constexpr double kEndless = std::numeric_limits<double>::max();

Vector3 clamped(const Vector3& vector, const driver::Workspace& box) noexcept {
  return {std::clamp(vector.x, box.low_m.x, box.high_m.x),
          std::clamp(vector.y, box.low_m.y, box.high_m.y),
          std::clamp(vector.z, box.low_m.z, box.high_m.z)};
}

driver::Quaternion normalised(const driver::Quaternion& turn) noexcept {
  const double length = std::hypot(std::hypot(turn.x, turn.y), std::hypot(turn.z, turn.w));
  if (!(length > 0) || !std::isfinite(length)) return {};
  return {turn.x / length, turn.y / length, turn.z / length, turn.w / length};
}

}  // namespace

bool is_finite(const driver::Setpoint& setpoint) noexcept {
  const driver::Quaternion& turn = setpoint.pose.orientation;
  const auto is_number = [](double value) { return std::isfinite(value); };
  return is_finite(setpoint.wrench) && is_finite(setpoint.pose.position_m) &&
         is_finite(setpoint.twist.linear_m_per_s) && is_finite(setpoint.twist.angular_rad_per_s) &&
         is_number(turn.x) && is_number(turn.y) && is_number(turn.z) && is_number(turn.w) &&
         std::ranges::all_of(setpoint.joints, is_number) &&
         std::ranges::all_of(setpoint.outputs, is_number);
}

SetpointLimiter::SetpointLimiter(const driver::Descriptor& descriptor)
    : workspace_(descriptor.workspace),
      velocity_m_per_s_max_(descriptor.limits.velocity_m_per_s_max),
      velocity_rad_per_s_max_(descriptor.limits.velocity_rad_per_s_max) {
  modes_[0] = true;
  for (const CommandMode mode : descriptor.modes)
    modes_.at(static_cast<std::size_t>(mode)) = true;
  for (std::size_t i = 0; i < descriptor.joints.size(); ++i) {
    const driver::Joint& joint = descriptor.joints[i];
    const bool is_endless = joint.low == joint.high;
    positions_[i] = is_endless ? Range{-kEndless, kEndless} : Range{joint.low, joint.high};
    velocities_max_[i] = joint.velocity_max;
    efforts_max_[i] = joint.effort_max;
  }
  for (std::size_t i = 0; i < descriptor.outputs.size(); ++i) {
    const driver::Output& output = descriptor.outputs[i];
    outputs_[i] = {output.low, output.high};
    safe_outputs_[i] = static_cast<float>(output.safe);
  }
}

bool SetpointLimiter::takes(CommandMode mode) const noexcept {
  const auto index = static_cast<std::size_t>(mode);
  return index < modes_.size() && modes_[index];
}

double SetpointLimiter::limit_joint(std::size_t joint, CommandMode mode,
                                    double value) const noexcept {
  switch (mode) {
    case CommandMode::kJointPosition:
      return std::clamp(value, positions_[joint].low, positions_[joint].high);
    case CommandMode::kJointVelocity:
      return std::clamp(value, -velocities_max_[joint], velocities_max_[joint]);
    case CommandMode::kJointEffort:
      return std::clamp(value, -efforts_max_[joint], efforts_max_[joint]);
    default:
      return 0;
  }
}

driver::Setpoint SetpointLimiter::limit(const driver::Setpoint& setpoint) const noexcept {
  driver::Setpoint limited;
  limited.mode = setpoint.mode;
  limited.pose = {clamped(setpoint.pose.position_m, workspace_),
                  normalised(setpoint.pose.orientation)};
  limited.twist = {shortened(setpoint.twist.linear_m_per_s, velocity_m_per_s_max_),
                   shortened(setpoint.twist.angular_rad_per_s, velocity_rad_per_s_max_)};
  for (std::size_t i = 0; i < limited.joints.size(); ++i)
    limited.joints[i] = limit_joint(i, setpoint.mode, setpoint.joints[i]);
  for (std::size_t i = 0; i < limited.outputs.size(); ++i) {
    limited.outputs[i] = static_cast<float>(
        std::clamp<double>(setpoint.outputs[i], outputs_[i].low, outputs_[i].high));
  }
  return limited;
}

}  // namespace rtpm::gvd
