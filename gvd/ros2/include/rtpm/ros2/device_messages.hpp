#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/ros2/messages.hpp"

/// A device's samples as messages of ROS 2.
namespace rtpm::ros2 {

/// The messages that a device has, by its parts.
struct Subjects {
  bool has_pose = false;    ///< And a twist: an axis is sensed.
  bool has_wrench = false;  ///< It applies forces.
  bool has_joints = false;
  bool has_joy = false;  ///< It has analogs or buttons.
  bool has_imu = false;  ///< Three of its analogs are accelerations, or rates of turn.
};
[[nodiscard]] Subjects subjects_of(const driver::Descriptor& device);

// Topics below the device's name.
inline constexpr std::string_view kPoseTopic = "pose";
inline constexpr std::string_view kTwistTopic = "twist";
inline constexpr std::string_view kWrenchTopic = "applied_wrench";
inline constexpr std::string_view kJointsTopic = "joint_states";
inline constexpr std::string_view kJoyTopic = "joy";
inline constexpr std::string_view kImuTopic = "imu/data";

/// @param realtime_ns  of CLOCK_REALTIME
[[nodiscard]] Time time_of(std::int64_t realtime_ns) noexcept;

/// In the device's frame, as all others are.
[[nodiscard]] PoseStamped pose_of(const driver::Descriptor& device, const driver::Sample& sample,
                                  Time stamp);
/// The pose as the transform from the device's frame to `child_frame`.
[[nodiscard]] TransformStamped transform_of(const driver::Descriptor& device,
                                            const driver::Sample& sample, Time stamp,
                                            std::string child_frame);
/// In the device's frame, not in that of the moving body.
[[nodiscard]] TwistStamped twist_of(const driver::Descriptor& device, const driver::Sample& sample,
                                    Time stamp);
/// The wrench that the actuators apply to the user; a force sensor of ROS shows the opposite.
[[nodiscard]] WrenchStamped applied_wrench_of(const driver::Descriptor& device,
                                              const driver::Sample& sample, Time stamp);
/// The joints in the descriptor's order.
[[nodiscard]] JointState joint_state_of(const driver::Descriptor& device,
                                        const driver::Sample& sample, Time stamp);
/// The analogs, each scaled from its range to -1 … 1, and the buttons as 0 or 1.
[[nodiscard]] Joy joy_of(const driver::Descriptor& device, const driver::Sample& sample,
                         Time stamp);
/// The analogs in m/s² and rad/s, and the orientation if it is sensed. The covariance of a missing
/// part begins with -1; the others are unknown.
[[nodiscard]] Imu imu_of(const driver::Descriptor& device, const driver::Sample& sample,
                         Time stamp);
/// Error in a fault or a latched stop, warning with any other fault, stale while it is not active.
/// @param name  of the device, as RTPM has it
[[nodiscard]] DiagnosticStatus status_of(std::string_view name, const driver::Descriptor& device,
                                         const driver::Sample& sample);

}  // namespace rtpm::ros2
