#include "rtpm/ros2/device_messages.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace rtpm::ros2 {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

/// The faults that stop a device until a person acts.
constexpr driver::Faults stopping_faults() {
  driver::Faults faults;
  for (const driver::Fault fault : {driver::Fault::kDeviceGone, driver::Fault::kCommandNotFinite,
                                    driver::Fault::kEmergencyStop, driver::Fault::kTooFast})
    faults.set(fault);
  return faults;
}

Header header_of(const driver::Descriptor& device, Time stamp) {
  return {.stamp = stamp, .frame_id = device.frame};
}
Vector3 vector_of(const driver::Vector3& from) {
  return {.x = from.x, .y = from.y, .z = from.z};
}
Quaternion rotation_of(const driver::Quaternion& from) {
  return {.x = from.x, .y = from.y, .z = from.z, .w = from.w};
}

std::size_t analog_count_of(const driver::Descriptor& device) {
  return std::min(device.analogs.size(), driver::kAnalogCountMax);
}

/// The indices of the three analogs with this unit; empty if there is another number of them.
std::optional<std::array<std::size_t, 3>> three_in(const driver::Descriptor& device,
                                                   std::string_view unit) {
  std::array<std::size_t, 3> indices{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < analog_count_of(device); ++i) {
    if (device.analogs[i].unit != unit) continue;
    if (count < indices.size()) indices[count] = i;
    ++count;
  }
  return count == indices.size() ? std::optional(indices) : std::nullopt;
}
constexpr std::string_view kAcceleration = "m/s^2";
constexpr std::string_view kRateOfTurn = "rad/s";

bool senses_rotation(const driver::Descriptor& device) {
  return std::ranges::any_of(device.axes, [](const driver::Axis& axis) {
    return axis.is_sensed && axis.name.starts_with('r');
  });
}

/// Fills a vector from three analogs, or marks it as missing.
void fill(const driver::Descriptor& device, const driver::Sample& sample, std::string_view unit,
          Vector3& vector, std::array<double, 9>& covariance) {
  const auto indices = three_in(device, unit);
  if (!indices) {
    covariance[0] = -1;
    return;
  }
  vector = {.x = sample.analogs[(*indices)[0]],
            .y = sample.analogs[(*indices)[1]],
            .z = sample.analogs[(*indices)[2]]};
}

}  // namespace

Subjects subjects_of(const driver::Descriptor& device) {
  return {.has_pose = std::ranges::any_of(device.axes, &driver::Axis::is_sensed),
          .has_wrench = std::ranges::any_of(device.axes, &driver::Axis::is_actuated),
          .has_joints = !device.joints.empty(),
          .has_joy = !device.analogs.empty() || !device.buttons.empty(),
          .has_imu = three_in(device, kAcceleration) || three_in(device, kRateOfTurn)};
}

Time time_of(std::int64_t realtime_ns) noexcept {
  std::int64_t sec = realtime_ns / kNsPerSecond;
  std::int64_t nanosec = realtime_ns % kNsPerSecond;
  if (nanosec < 0) {
    --sec;
    nanosec += kNsPerSecond;
  }
  return {.sec = static_cast<std::int32_t>(sec), .nanosec = static_cast<std::uint32_t>(nanosec)};
}

PoseStamped pose_of(const driver::Descriptor& device, const driver::Sample& sample, Time stamp) {
  const driver::Vector3& at = sample.pose.position_m;
  return {.header = header_of(device, stamp),
          .pose = {.position = {.x = at.x, .y = at.y, .z = at.z},
                   .orientation = rotation_of(sample.pose.orientation)}};
}

TransformStamped transform_of(const driver::Descriptor& device, const driver::Sample& sample,
                              Time stamp, std::string child_frame) {
  return {.header = header_of(device, stamp),
          .child_frame_id = std::move(child_frame),
          .transform = {.translation = vector_of(sample.pose.position_m),
                        .rotation = rotation_of(sample.pose.orientation)}};
}

TwistStamped twist_of(const driver::Descriptor& device, const driver::Sample& sample, Time stamp) {
  return {.header = header_of(device, stamp),
          .twist = {.linear = vector_of(sample.twist.linear_m_per_s),
                    .angular = vector_of(sample.twist.angular_rad_per_s)}};
}

WrenchStamped applied_wrench_of(const driver::Descriptor& device, const driver::Sample& sample,
                                Time stamp) {
  return {.header = header_of(device, stamp),
          .wrench = {.force = vector_of(sample.wrench_applied.force_newton),
                     .torque = vector_of(sample.wrench_applied.torque_newton_metre)}};
}

JointState joint_state_of(const driver::Descriptor& device, const driver::Sample& sample,
                          Time stamp) {
  JointState state{.header = header_of(device, stamp)};
  const auto count =
      static_cast<std::ptrdiff_t>(std::min(device.joints.size(), driver::kJointCountMax));
  for (std::ptrdiff_t i = 0; i < count; ++i)
    state.name.push_back(device.joints[static_cast<std::size_t>(i)].name);
  state.position.assign(sample.joints.begin(), sample.joints.begin() + count);
  state.velocity.assign(sample.joint_velocities.begin(), sample.joint_velocities.begin() + count);
  state.effort.assign(sample.efforts_applied.begin(), sample.efforts_applied.begin() + count);
  return state;
}

Joy joy_of(const driver::Descriptor& device, const driver::Sample& sample, Time stamp) {
  Joy joy{.header = header_of(device, stamp)};
  for (std::size_t i = 0; i < analog_count_of(device); ++i) {
    const auto& [name, unit, low, high] = device.analogs[i];
    const double share = high > low ? (double{sample.analogs[i]} - low) / (high - low) : 0.5;
    joy.axes.push_back(static_cast<float>(std::clamp(2 * share - 1, -1.0, 1.0)));
  }
  for (std::size_t i = 0; i < std::min(device.buttons.size(), driver::kButtonCountMax); ++i)
    joy.buttons.push_back(static_cast<std::int32_t>(sample.buttons >> i & 1));
  return joy;
}

Imu imu_of(const driver::Descriptor& device, const driver::Sample& sample, Time stamp) {
  Imu imu{.header = header_of(device, stamp)};
  if (senses_rotation(device)) {
    imu.orientation = rotation_of(sample.pose.orientation);
  } else {
    imu.orientation_covariance[0] = -1;
  }
  fill(device, sample, kRateOfTurn, imu.angular_velocity, imu.angular_velocity_covariance);
  fill(device, sample, kAcceleration, imu.linear_acceleration, imu.linear_acceleration_covariance);
  return imu;
}

DiagnosticStatus status_of(std::string_view name, const driver::Descriptor& device,
                           const driver::Sample& sample) {
  DiagnosticStatus status{.name = std::string(name),
                          .message = std::string(driver::to_string(sample.lifecycle)),
                          .hardware_id = device.model + " " + device.serial};
  if (!sample.faults.empty()) status.message += ": " + driver::to_text(sample.faults);
  const bool is_stopped = !sample.faults.only(stopping_faults()).empty();
  if (sample.lifecycle == driver::Lifecycle::kFault || is_stopped) {
    status.level = DiagnosticStatus::kError;
  } else if (sample.lifecycle != driver::Lifecycle::kActive) {
    status.level = DiagnosticStatus::kStale;
  } else if (!sample.faults.empty()) {
    status.level = DiagnosticStatus::kWarn;
  }
  status.values = {{"lifecycle", std::string(driver::to_string(sample.lifecycle))},
                   {"faults", driver::to_text(sample.faults)},
                   {"success_rate", std::to_string(sample.success_rate)},
                   {"cycle", std::to_string(sample.sequence)}};
  return status;
}

}  // namespace rtpm::ros2
