#include "rtpm/device_sim/knob_driver.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "settings.hpp"

namespace rtpm::device_sim {
namespace {

// Their product is the stiffness in a detent, which must be stable for a step of kStepMax.
constexpr std::int64_t kDetentCountMax = 36;
constexpr double kDetentNewtonMetreMax = 0.01;

}  // namespace

driver::Descriptor KnobDriver::describe() const {
  driver::Descriptor descriptor = identity(driver::DeviceClass::kDial, "RTPM simulated knob");
  descriptor.joints = {
      {.name = "dial", .unit = "rad", .effort_max = knob_.effort_newton_metre_max}};
  descriptor.buttons = {"push"};
  descriptor.modes = {driver::CommandMode::kJointEffort};
  return descriptor;
}

std::vector<driver::ParameterSpec> KnobDriver::parameters() const {
  return {{.name = "detent.count",
           .type = driver::ParameterType::kInteger,
           .low = 0,
           .high = kDetentCountMax,
           .default_value = std::int64_t{0},
           .description = "Detents of a turn; 0: it turns smoothly."},
          {.name = "detent.torque_newton_metre",
           .unit = "N m",
           .low = 0,
           .high = kDetentNewtonMetreMax,
           .default_value = kDetentNewtonMetreMax,
           .description = "Greatest torque of a detent."}};
}

expected<void, SetupError> KnobDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  take(settings, "detent.count", detent_count_);
  take(settings, "detent.torque_newton_metre", detent_newton_metre_max_);
  return {};
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

double KnobDriver::detent_newton_metre() const noexcept {
  return -detent_newton_metre_max_ * std::sin(static_cast<double>(detent_count_) * angle_rad_);
}

void KnobDriver::step(const driver::Command& command, double elapsed_s,
                      driver::Sample& sample) noexcept {
  const bool has_effort = command.mode == driver::CommandMode::kJointEffort;
  const double asked = has_effort && std::isfinite(command.joints[0]) ? command.joints[0] : 0;
  const double effort =
      std::clamp(asked, -knob_.effort_newton_metre_max, knob_.effort_newton_metre_max);
  // Implicit in the velocity, so that no long step can add energy.
  velocity_rad_per_s_ = (knob_.inertia_kg_m2 * velocity_rad_per_s_ +
                         elapsed_s * (effort + hand_newton_metre() + detent_newton_metre())) /
                        (knob_.inertia_kg_m2 + elapsed_s * knob_.damping_newton_metre_s_per_rad);
  angle_rad_ += elapsed_s * velocity_rad_per_s_;
  sample.joints[0] = std::round(angle_rad_ / knob_.resolution_rad) * knob_.resolution_rad;
  sample.joint_velocities[0] = velocity_rad_per_s_;
  sample.efforts_applied[0] = effort;
  if (has_effort && effort != command.joints[0]) sample.faults.set(driver::Fault::kDeviceSaturated);
  set_button(sample, std::fmod(time_s(), 3.0) >= 2.9);
}

}  // namespace rtpm::device_sim
