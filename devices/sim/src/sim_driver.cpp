#include "rtpm/device_sim/sim_driver.hpp"

#include <array>
#include <cmath>
#include <utility>

namespace rtpm::device_sim {
namespace {

constexpr double kRateHz = 1000;

driver::Vector3 to_driver(const Eigen::Vector3d& vector) noexcept {
  return {vector.x(), vector.y(), vector.z()};
}

Eigen::Vector3d to_eigen(const driver::Vector3& vector) noexcept {
  return {vector.x, vector.y, vector.z};
}

/// The stiffest wall that a loop inside the device may render. A position is one period old when
/// its force acts, and the force then stands for a period, half of one on average. Source:
/// Colgate's condition for sampled walls, b > K · (T / 2 + delay).
double stiffness_max_of(const ArmConfig& arm) noexcept {
  return arm.damping_newton_s_per_m / (1.5 / kRateHz);
}

struct Setting {
  const char* name;
  double value;
};

}  // namespace

expected<std::unique_ptr<SimDriver>, SetupError> SimDriver::create(SimConfig config) {
  const std::array settings{
      Setting{"mass_kg", config.arm.mass_kg},
      Setting{"damping_newton_s_per_m", config.arm.damping_newton_s_per_m},
      Setting{"force_newton_max", config.arm.force_newton_max},
      Setting{"resolution_m", config.arm.resolution_m},
      Setting{"hand stiffness_newton_per_m", config.hand.stiffness_newton_per_m},
      Setting{"hand damping_newton_s_per_m", config.hand.damping_newton_s_per_m},
      Setting{"hand force_newton_max", config.hand.force_newton_max},
  };
  for (const Setting& setting : settings) {
    if (std::isfinite(setting.value) && setting.value > 0) continue;
    return setup_error(std::string("the simulated arm's ") + setting.name +
                       " is no number above zero");
  }
  std::optional<Hand> hand;
  if (config.is_held && config.hand_file.empty()) {
    hand.emplace(config.hand, PressingPath{config.seed});
  } else if (config.is_held) {
    auto recording = Trajectory::load(config.hand_file, config.arm.workspace);
    if (!recording) return unexpected{recording.error()};
    hand.emplace(config.hand, std::move(*recording));
  }
  return std::unique_ptr<SimDriver>(new SimDriver(std::move(config), std::move(hand)));
}

driver::Descriptor SimDriver::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kHaptic;
  descriptor.model = "RTPM simulated arm";
  descriptor.serial = config_.serial;
  descriptor.frame = config_.frame;
  for (const char* name : {"x", "y", "z"}) {
    descriptor.axes.push_back({.name = name, .is_sensed = true, .is_actuated = true});
  }
  descriptor.buttons = {"stylus"};
  descriptor.modes = {driver::CommandMode::kForce};
  descriptor.limits.force_newton_max = config_.arm.force_newton_max;
  descriptor.limits.stiffness_newton_per_m_max = stiffness_max_of(config_.arm);
  descriptor.limits.damping_newton_s_per_m = config_.arm.damping_newton_s_per_m;
  descriptor.workspace = config_.arm.workspace;
  descriptor.rate_hz = kRateHz;
  descriptor.position_resolution_m = config_.arm.resolution_m;
  return descriptor;
}

expected<void, SetupError> SimDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0} || config.period > Arm::kStepMax) {
    return setup_error("the simulated arm runs at 50 Hz or faster",
                       "a longer period is beyond its longest step");
  }
  period_ = config.period;
  return {};
}

expected<void, SetupError> SimDriver::activate() {
  if (hand_) {
    arm_.emplace(config_.arm, *hand_);
  } else {
    arm_.emplace(config_.arm);
  }
  velocity_ = {};
  last_cycle_.reset();
  return {};
}

driver::ExchangeStatus SimDriver::exchange(const driver::Command& command,
                                           driver::Sample& sample) noexcept {
  if (!arm_) return driver::ExchangeStatus::kGone;
  const Duration elapsed = last_cycle_ ? command.cycle_time - *last_cycle_ : period_;
  last_cycle_ = command.cycle_time;
  const bool has_force = command.mode == driver::CommandMode::kForce;
  arm_->step(has_force ? to_eigen(command.wrench.force_newton) : Eigen::Vector3d::Zero(), elapsed);

  const Eigen::Vector3d position_m = arm_->measured_position_m();
  sample.host_time = command.cycle_time;
  sample.device_time =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(arm_->time_s()));
  sample.pose = {to_driver(position_m), {}};
  sample.twist = {to_driver(velocity_.update(position_m, arm_->time_s())), {}};
  sample.wrench_applied = {to_driver(arm_->applied_newton()), {}};
  const std::uint32_t buttons = arm_->is_button_pressed() ? 1 : 0;
  if (std::exchange(sample.buttons, buttons) != buttons) ++sample.button_edges[0];
  if (arm_->is_saturated()) sample.faults.set(driver::Fault::kDeviceSaturated);
  if (arm_->is_at_stop()) sample.faults.set(driver::Fault::kOutsideWorkspace);
  return driver::ExchangeStatus::kOk;
}

void SimDriver::deactivate() noexcept {
  arm_.reset();
}

}  // namespace rtpm::device_sim
