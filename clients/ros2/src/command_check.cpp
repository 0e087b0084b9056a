#include "command_check.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>

#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/messages.hpp"

namespace rtpm::ros2 {
namespace {

using Read = expected<driver::Setpoint, CommandDrop>;

/// How far a quaternion's length may be from 1, as single precision and rounding make it.
constexpr double kLengthError = 1e-3;

std::optional<CommandDrop> check(const Header& header, const driver::Descriptor& descriptor,
                                 const CommandTime& time) {
  const std::int64_t stamp_ns =
      std::int64_t{header.stamp.sec} * 1'000'000'000 + header.stamp.nanosec;
  if (stamp_ns < time.now_ns - time.age_max.count()) return CommandDrop::kStale;
  if (stamp_ns > time.now_ns + time.age_max.count()) return CommandDrop::kFuture;
  if (!header.frame_id.empty() && header.frame_id != descriptor.frame)
    return CommandDrop::kOtherFrame;
  return std::nullopt;
}

template <class Vector>
driver::Vector3 vector_of(const Vector& from) {
  return {from.x, from.y, from.z};
}

bool is_finite(const driver::Vector3& vector) {
  return std::isfinite(vector.x) && std::isfinite(vector.y) && std::isfinite(vector.z);
}

Read setpoint_of(const WrenchStamped& message, const driver::Descriptor&) {
  driver::Setpoint setpoint;
  setpoint.mode = driver::CommandMode::kForce;
  setpoint.wrench = {vector_of(message.wrench.force), vector_of(message.wrench.torque)};
  if (!is_finite(vector_of(message.wrench.force)) || !is_finite(vector_of(message.wrench.torque)))
    return unexpected{CommandDrop::kNotFinite};
  return setpoint;
}

Read setpoint_of(const TwistStamped& message, const driver::Descriptor&) {
  driver::Setpoint setpoint;
  setpoint.mode = driver::CommandMode::kVelocity;
  setpoint.twist = {vector_of(message.twist.linear), vector_of(message.twist.angular)};
  if (!is_finite(vector_of(message.twist.linear)) || !is_finite(vector_of(message.twist.angular)))
    return unexpected{CommandDrop::kNotFinite};
  return setpoint;
}

Read setpoint_of(const PoseStamped& message, const driver::Descriptor&) {
  const Quaternion& q = message.pose.orientation;
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  // Also false for a NaN.
  if (!is_finite(vector_of(message.pose.position)) || !(std::abs(length - 1) < kLengthError))
    return unexpected{CommandDrop::kNotFinite};
  driver::Setpoint setpoint;
  setpoint.mode = driver::CommandMode::kPose;
  setpoint.pose.position_m = vector_of(message.pose.position);
  setpoint.pose.orientation = {q.x / length, q.y / length, q.z / length, q.w / length};
  return setpoint;
}

Read setpoint_of(const JointState& message, const driver::Descriptor& descriptor) {
  using driver::CommandMode;
  driver::Setpoint setpoint;
  std::span<const double> values;
  const auto use = [&](const std::vector<double>& given, CommandMode mode) {
    if (given.empty()) return true;
    if (!values.empty()) return false;
    values = given;
    setpoint.mode = mode;
    return true;
  };
  if (!use(message.position, CommandMode::kJointPosition) ||
      !use(message.velocity, CommandMode::kJointVelocity) ||
      !use(message.effort, CommandMode::kJointEffort) || values.size() != message.name.size() ||
      values.size() != descriptor.joints.size() || values.size() > driver::kJointCountMax ||
      std::ranges::find(descriptor.modes, setpoint.mode) == descriptor.modes.end())
    return unexpected{CommandDrop::kOddJoints};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto at = std::ranges::find(message.name, descriptor.joints[i].name);
    if (at == message.name.end()) return unexpected{CommandDrop::kOddJoints};
    const double value = values[static_cast<std::size_t>(at - message.name.begin())];
    if (!std::isfinite(value)) return unexpected{CommandDrop::kNotFinite};
    setpoint.joints[i] = value;
  }
  return setpoint;
}

template <class Message>
Read read(ConstBytes cdr, const driver::Descriptor& descriptor, const CommandTime& time) {
  const auto message = decode<Message>(cdr);
  if (!message) return unexpected{CommandDrop::kUnreadable};
  if (const auto drop = check(message->header, descriptor, time)) return unexpected{*drop};
  return setpoint_of(*message, descriptor);
}

}  // namespace

std::string_view to_string(CommandDrop drop) noexcept {
  switch (drop) {
    case CommandDrop::kUnreadable:
      return "unreadable";
    case CommandDrop::kStale:
      return "stale stamp";
    case CommandDrop::kFuture:
      return "stamp in the future";
    case CommandDrop::kOtherFrame:
      return "other frame";
    case CommandDrop::kNotFinite:
      return "not finite";
    case CommandDrop::kOddJoints:
      return "odd joints";
    case CommandDrop::kReplaced:
      return "replaced by a newer one";
    case CommandDrop::kRefused:
      return "refused";
  }
  return "unknown";
}

std::string_view subject_of(CommandKind kind) noexcept {
  switch (kind) {
    case CommandKind::kWrench:
      return "command/wrench";
    case CommandKind::kPose:
      return "command/pose";
    case CommandKind::kTwist:
      return "command/twist";
    case CommandKind::kJoints:
      return "command/joints";
  }
  return "command";
}

std::vector<CommandKind> command_kinds_of(const driver::Descriptor& descriptor) {
  using driver::CommandMode;
  const auto has = [&](CommandMode mode) {
    return std::ranges::find(descriptor.modes, mode) != descriptor.modes.end();
  };
  std::vector<CommandKind> kinds;
  if (has(CommandMode::kForce)) kinds.push_back(CommandKind::kWrench);
  if (has(CommandMode::kPose)) kinds.push_back(CommandKind::kPose);
  if (has(CommandMode::kVelocity)) kinds.push_back(CommandKind::kTwist);
  if (has(CommandMode::kJointPosition) || has(CommandMode::kJointVelocity) ||
      has(CommandMode::kJointEffort))
    kinds.push_back(CommandKind::kJoints);
  return kinds;
}

Read read_command(CommandKind kind, ConstBytes cdr, const driver::Descriptor& descriptor,
                  const CommandTime& time) {
  switch (kind) {
    case CommandKind::kWrench:
      return read<WrenchStamped>(cdr, descriptor, time);
    case CommandKind::kPose:
      return read<PoseStamped>(cdr, descriptor, time);
    case CommandKind::kTwist:
      return read<TwistStamped>(cdr, descriptor, time);
    case CommandKind::kJoints:
      return read<JointState>(cdr, descriptor, time);
  }
  return unexpected{CommandDrop::kUnreadable};
}

}  // namespace rtpm::ros2
