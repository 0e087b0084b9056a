#include "wire.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace rtpm::gvd {
namespace {

std::uint32_t to_us(Duration duration) noexcept {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(us, 0, UINT32_MAX));
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
  const driver::Quaternion& turn = sample.pose.orientation;
  return {sample.sequence,
          to_ns(sample.host_time),
          sample.device_time.count(),
          to_wire(sample.pose.position_m),
          {turn.x, turn.y, turn.z, turn.w},
          to_wire(sample.twist.linear_m_per_s),
          to_wire(sample.twist.angular_rad_per_s),
          to_wire(sample.wrench_applied.force_newton),
          to_wire(sample.wrench_applied.torque_newton_metre),
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
  const device::Quaternion& turn = wire.orientation();
  sample.pose = {from_wire(wire.position_m()), {turn.x(), turn.y(), turn.z(), turn.w()}};
  sample.twist = {from_wire(wire.linear_m_per_s()), from_wire(wire.angular_rad_per_s())};
  sample.wrench_applied = {from_wire(wire.force_newton()), from_wire(wire.torque_newton_metre())};
  for (std::uint16_t i = 0; i < driver::kAnalogCountMax; ++i) {
    sample.analogs[i] = wire.analogs()->Get(i);
  }
  sample.buttons = wire.buttons();
  sample.faults = driver::Faults{wire.faults()};
  for (std::uint16_t i = 0; i < driver::kButtonCountMax; ++i) {
    sample.button_edges[i] = wire.button_edges()->Get(i);
  }
  sample.success_rate = wire.success_rate();
  sample.lifecycle = wire.lifecycle() < driver::kLifecycleCount
                         ? static_cast<driver::Lifecycle>(wire.lifecycle())
                         : driver::Lifecycle::kFault;
  return sample;
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
  const auto model = builder.CreateString(descriptor.model);
  const auto serial = builder.CreateString(descriptor.serial);
  const auto frame = builder.CreateString(descriptor.frame);
  const auto axes_at = builder.CreateVector(axes);
  const auto buttons_at = builder.CreateVectorOfStrings(descriptor.buttons);
  const auto analogs_at = builder.CreateVector(analogs);
  const device::Vector3 low = to_wire(descriptor.workspace.low_m);
  const device::Vector3 high = to_wire(descriptor.workspace.high_m);
  const driver::Limits& limits = descriptor.limits;
  return device::CreateDescription(
      builder, static_cast<device::DeviceClass>(descriptor.device_class), model, serial, frame,
      axes_at, buttons_at, analogs_at, limits.force_newton_max, limits.torque_newton_metre_max,
      limits.stiffness_newton_per_m_max, limits.damping_newton_s_per_m, &low, &high,
      descriptor.position_resolution_m, 1.0 / std::chrono::duration<double>(terms.period).count(),
      to_us(terms.hold_max), to_us(terms.ramp), terms.operator_priority.value());
}

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
    descriptor.buttons.push_back(text_of(button));
  }
  for (const device::Analog* analog : *wire.analogs()) {
    descriptor.analogs.push_back(
        {text_of(analog->name()), text_of(analog->unit()), analog->low(), analog->high()});
  }
  descriptor.limits = {wire.force_newton_max(), wire.torque_newton_metre_max(),
                       wire.stiffness_newton_per_m_max(), wire.damping_newton_s_per_m()};
  descriptor.workspace = {from_wire(*wire.workspace_low_m()), from_wire(*wire.workspace_high_m())};
  descriptor.rate_hz = wire.rate_hz();
  descriptor.position_resolution_m = wire.position_resolution_m();
  return descriptor;
}

}  // namespace rtpm::gvd
