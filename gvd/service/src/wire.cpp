#include "rtpm/gvd/wire.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "rtpm/gvd/command_lease.hpp"

namespace rtpm::gvd {
namespace {

std::uint32_t to_us(Duration duration) noexcept {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(us, 0, UINT32_MAX));
}

device::Quaternion quaternion_to_wire(const driver::Quaternion& turn) noexcept {
  return {turn.x, turn.y, turn.z, turn.w};
}

driver::Quaternion quaternion_from_wire(const device::Quaternion& turn) noexcept {
  return {turn.x(), turn.y(), turn.z(), turn.w()};
}

/// Copies a fixed array of a struct.
template <class Array, class Wire>
void copy(Array& to, const Wire* from) noexcept {
  for (std::uint16_t i = 0; i < to.size(); ++i)
    to[i] = from->Get(i);
}

std::string text_of(const flatbuffers::String* text) {
  return text == nullptr ? std::string{} : text->str();
}

}  // namespace

device::Vector3 to_wire(const driver::Vector3& vector) noexcept {
  return {vector.x, vector.y, vector.z};
}

driver::Vector3 from_wire(const device::Vector3& vector) noexcept {
  return {vector.x(), vector.y(), vector.z()};
}

device::Sample to_wire(const driver::Sample& sample) noexcept {
  return {sample.sequence,
          to_ns(sample.host_time),
          sample.device_time.count(),
          to_wire(sample.pose.position_m),
          quaternion_to_wire(sample.pose.orientation),
          to_wire(sample.twist.linear_m_per_s),
          to_wire(sample.twist.angular_rad_per_s),
          to_wire(sample.wrench_applied.force_newton),
          to_wire(sample.wrench_applied.torque_newton_metre),
          sample.joints,
          sample.joint_velocities,
          sample.efforts_applied,
          sample.outputs_applied,
          sample.analogs,
          sample.buttons,
          sample.faults.bits(),
          sample.button_edges,
          sample.success_rate,
          static_cast<std::uint8_t>(sample.lifecycle)};
}

driver::Sample from_wire(const device::Sample& wire) noexcept {
  driver::Sample sample;
  sample.sequence = wire.sequence();
  sample.host_time = time_from_ns(wire.host_time_ns());
  sample.device_time = Duration{wire.device_time_ns()};
  sample.pose = {from_wire(wire.position_m()), quaternion_from_wire(wire.orientation())};
  sample.twist = {from_wire(wire.linear_m_per_s()), from_wire(wire.angular_rad_per_s())};
  sample.wrench_applied = {from_wire(wire.force_newton()), from_wire(wire.torque_newton_metre())};
  copy(sample.joints, wire.joints());
  copy(sample.joint_velocities, wire.joint_velocities());
  copy(sample.efforts_applied, wire.efforts());
  copy(sample.outputs_applied, wire.outputs());
  copy(sample.analogs, wire.analogs());
  sample.buttons = wire.buttons();
  sample.faults = driver::Faults{wire.faults()};
  copy(sample.button_edges, wire.button_edges());
  sample.success_rate = wire.success_rate();
  sample.lifecycle = wire.lifecycle() < driver::kLifecycleCount
                         ? static_cast<driver::Lifecycle>(wire.lifecycle())
                         : driver::Lifecycle::kFault;
  return sample;
}

ClientCommand from_wire(const device::Command& wire) noexcept {
  ClientCommand command;
  command.lease = wire.lease();
  command.sequence = wire.sequence();
  command.hold = std::chrono::microseconds{wire.hold_us()};
  driver::Setpoint& setpoint = command.setpoint;
  setpoint.mode = static_cast<driver::CommandMode>(wire.mode());
  setpoint.wrench = {from_wire(wire.force_newton()), from_wire(wire.torque_newton_metre())};
  setpoint.pose = {from_wire(wire.position_m()), quaternion_from_wire(wire.orientation())};
  setpoint.twist = {from_wire(wire.linear_m_per_s()), from_wire(wire.angular_rad_per_s())};
  copy(setpoint.joints, wire.joints());
  copy(setpoint.outputs, wire.outputs());
  return command;
}

device::Command to_wire(const ClientCommand& command) noexcept {
  const driver::Setpoint& setpoint = command.setpoint;
  return {to_wire(setpoint.wrench.force_newton),
          to_wire(setpoint.wrench.torque_newton_metre),
          to_wire(setpoint.pose.position_m),
          quaternion_to_wire(setpoint.pose.orientation),
          to_wire(setpoint.twist.linear_m_per_s),
          to_wire(setpoint.twist.angular_rad_per_s),
          setpoint.joints,
          setpoint.outputs,
          command.lease,
          command.sequence,
          to_us(command.hold),
          static_cast<device::CommandMode>(setpoint.mode)};
}

device::Outcome to_wire(DeviceOutcome outcome) noexcept {
  return device::Outcome{static_cast<device::OutcomeCode>(outcome)};
}

device::Lease granted_to_wire(std::uint64_t id, const LeaseConfig& config) noexcept {
  const auto us = [](Duration duration) {
    return static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(duration).count());
  };
  return {id, us(config.silence_max), us(config.idle_max), device::OutcomeCode::Done};
}

device::Lease refused_to_wire(DeviceOutcome outcome) noexcept {
  return {Lease::kNobody, 0, 0, static_cast<device::OutcomeCode>(outcome)};
}

flatbuffers::Offset<device::Description> to_wire(const driver::Descriptor& descriptor,
                                                 const ServerTerms& terms,
                                                 flatbuffers::FlatBufferBuilder& builder) {
  std::vector<flatbuffers::Offset<device::Axis>> axes;
  for (const driver::Axis& axis : descriptor.axes) {
    axes.push_back(device::CreateAxis(builder, builder.CreateString(axis.name), axis.is_sensed,
                                      axis.is_actuated));
  }
  std::vector<flatbuffers::Offset<device::Analog>> analogs;
  for (const driver::Analog& analog : descriptor.analogs) {
    const auto name = builder.CreateString(analog.name);
    const auto unit = builder.CreateString(analog.unit);
    analogs.push_back(device::CreateAnalog(builder, name, unit, analog.low, analog.high));
  }
  std::vector<flatbuffers::Offset<device::Joint>> joints;
  for (const driver::Joint& joint : descriptor.joints) {
    const auto name = builder.CreateString(joint.name);
    const auto unit = builder.CreateString(joint.unit);
    joints.push_back(device::CreateJoint(builder, name, unit, joint.low, joint.high,
                                         joint.velocity_max, joint.effort_max));
  }
  std::vector<flatbuffers::Offset<device::Output>> outputs;
  for (const driver::Output& output : descriptor.outputs) {
    const auto name = builder.CreateString(output.name);
    const auto unit = builder.CreateString(output.unit);
    outputs.push_back(
        device::CreateOutput(builder, name, unit, output.low, output.high, output.safe));
  }
  std::vector<std::uint8_t> modes;
  for (const driver::CommandMode mode : descriptor.modes)
    modes.push_back(static_cast<std::uint8_t>(mode));
  const auto model = builder.CreateString(descriptor.model);
  const auto serial = builder.CreateString(descriptor.serial);
  const auto frame = builder.CreateString(descriptor.frame);
  const auto axes_at = builder.CreateVector(axes);
  const auto buttons_at = builder.CreateVectorOfStrings(descriptor.buttons);
  const auto analogs_at = builder.CreateVector(analogs);
  const auto joints_at = builder.CreateVector(joints);
  const auto outputs_at = builder.CreateVector(outputs);
  const auto modes_at =
      builder.CreateVectorScalarCast<device::CommandMode>(modes.data(), modes.size());
  const device::Vector3 low = to_wire(descriptor.workspace.low_m);
  const device::Vector3 high = to_wire(descriptor.workspace.high_m);
  const driver::Limits& limits = descriptor.limits;
  return device::CreateDescription(
      builder, static_cast<device::DeviceClass>(descriptor.device_class), model, serial, frame,
      axes_at, buttons_at, analogs_at, limits.force_newton_max, limits.torque_newton_metre_max,
      limits.stiffness_newton_per_m_max, limits.damping_newton_s_per_m, &low, &high,
      descriptor.position_resolution_m, 1.0 / std::chrono::duration<double>(terms.period).count(),
      to_us(terms.hold_max), to_us(terms.ramp), terms.operator_priority.value(), joints_at,
      outputs_at, modes_at, limits.velocity_m_per_s_max, limits.velocity_rad_per_s_max);
}

// A server of a later version may describe more channels than a sample holds.
driver::Descriptor from_wire(const device::Description& wire) {
  driver::Descriptor descriptor;
  const auto device_class = static_cast<std::uint8_t>(wire.device_class());
  descriptor.device_class = device_class < driver::kDeviceClassCount
                                ? static_cast<driver::DeviceClass>(device_class)
                                : driver::DeviceClass::kInput;
  descriptor.model = text_of(wire.model());
  descriptor.serial = text_of(wire.serial());
  descriptor.frame = text_of(wire.frame());
  for (const device::Axis* axis : *wire.axes()) {
    descriptor.axes.push_back({text_of(axis->name()), axis->is_sensed(), axis->is_actuated()});
  }
  for (const flatbuffers::String* button : *wire.buttons()) {
    if (descriptor.buttons.size() == driver::kButtonCountMax) break;
    descriptor.buttons.push_back(text_of(button));
  }
  for (const device::Analog* analog : *wire.analogs()) {
    if (descriptor.analogs.size() == driver::kAnalogCountMax) break;
    descriptor.analogs.push_back(
        {text_of(analog->name()), text_of(analog->unit()), analog->low(), analog->high()});
  }
  for (const device::Joint* joint : *wire.joints()) {
    if (descriptor.joints.size() == driver::kJointCountMax) break;
    descriptor.joints.push_back({text_of(joint->name()), text_of(joint->unit()), joint->low(),
                                 joint->high(), joint->velocity_max(), joint->effort_max()});
  }
  for (const device::Output* output : *wire.outputs()) {
    if (descriptor.outputs.size() == driver::kOutputCountMax) break;
    descriptor.outputs.push_back({text_of(output->name()), text_of(output->unit()), output->low(),
                                  output->high(), output->safe()});
  }
  // This client can't request modes of a later version.
  for (const auto mode : *wire.modes()) {
    if (static_cast<std::uint8_t>(mode) >= driver::kCommandModeCount) continue;
    descriptor.modes.push_back(static_cast<driver::CommandMode>(mode));
  }
  descriptor.limits = {wire.force_newton_max(),           wire.torque_newton_metre_max(),
                       wire.stiffness_newton_per_m_max(), wire.damping_newton_s_per_m(),
                       wire.velocity_m_per_s_max(),       wire.velocity_rad_per_s_max()};
  descriptor.workspace = {from_wire(*wire.workspace_low_m()), from_wire(*wire.workspace_high_m())};
  descriptor.rate_hz = wire.rate_hz();
  descriptor.position_resolution_m = wire.position_resolution_m();
  return descriptor;
}

}  // namespace rtpm::gvd
