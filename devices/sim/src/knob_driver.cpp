#include "rtpm/device_sim/knob_driver.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtpm::device_sim {

driver::Descriptor KnobDriver::describe() const {
  driver::Descriptor descriptor = identity(driver::DeviceClass::kDial, "RTPM simulated knob");
  descriptor.joints = {
      {.name = "dial", .unit = "rad", .effort_max = knob_.effort_newton_metre_max}};
  descriptor.buttons = {"push"};
  descriptor.modes = {driver::CommandMode::kJointEffort};
  return descriptor;
}

void KnobDriver::reset() noexcept {
  angle_rad_ = 0;
  velocity_rad_per_s_ = 0;
}

double KnobDriver::hand_newton_metre() const noexcept {
  constexpr double kPeriodS = 4;
  const double phase_rad =
      2 * std::numbers::pi * (time_s() / kPeriodS + random_share(config().seed, 0));
  return knob_.hand_newton_metre * std::sin(phase_rad);
}

void KnobDriver::step(const driver::Command& command, double elapsed_s,
                      driver::Sample& sample) noexcept {
  const bool has_effort = command.mode == driver::CommandMode::kJointEffort;
  const double asked = has_effort && std::isfinite(command.joints[0]) ? command.joints[0] : 0;
  const double effort =
      std::clamp(asked, -knob_.effort_newton_metre_max, knob_.effort_newton_metre_max);
  // Implicit in the velocity, so that no long step can pump energy in.
  velocity_rad_per_s_ =
      (knob_.inertia_kg_m2 * velocity_rad_per_s_ + elapsed_s * (effort + hand_newton_metre())) /
      (knob_.inertia_kg_m2 + elapsed_s * knob_.damping_newton_metre_s_per_rad);
  angle_rad_ += elapsed_s * velocity_rad_per_s_;
  sample.joints[0] = std::round(angle_rad_ / knob_.resolution_rad) * knob_.resolution_rad;
  sample.joint_velocities[0] = velocity_rad_per_s_;
  sample.efforts_applied[0] = effort;
  if (has_effort && effort != command.joints[0]) sample.faults.set(driver::Fault::kDeviceSaturated);
  set_button(sample, std::fmod(time_s(), 3.0) >= 2.9);
}

}  // namespace rtpm::device_sim
