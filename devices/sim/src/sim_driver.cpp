#include "rtpm/device_sim/sim_driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "arm_calibration.hpp"
#include "rtpm/device_sim/twin.hpp"
#include "settings.hpp"

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
/// its force takes effect; the force then lasts one period, on average half a period. Source:
/// Colgate's condition for sampled walls, b > K · (T / 2 + delay).
double stiffness_max_of(const ArmConfig& arm) noexcept {
  return arm.damping_newton_s_per_m / (1.5 / kRateHz);
}

struct Setting {
  const char* name;
  double value;
};

std::vector<double> elements_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

/// Assigns the parameter `name` to `to` if it is in `settings`.
void take_vector(std::span<const driver::ParameterSetting> settings, std::string_view name,
                 Eigen::Vector3d& to) {
  const auto* const elements = find<std::vector<double>>(settings, name);
  if (elements != nullptr) to = Eigen::Vector3d(elements->data());
}

/// The encoder error, which depends only on the configuration.
Eigen::Vector3d encoder_error_of(const SimConfig& config) {
  Eigen::Vector3d error_m;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double share = random_share(config.seed, static_cast<std::uint64_t>(axis));
    error_m[axis] = config.encoder_error_m * (2 * share - 1);
  }
  return error_m;
}

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
  if (!(config.encoder_error_m >= 0 &&
        config.encoder_error_m < EncoderOffsetCalibration::kOffsetMaxMetres)) {
    return setup_error("the simulated arm's encoder_error_m is not from 0 to 0.02");
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

SimDriver::SimDriver(SimConfig config, std::optional<Hand> hand)
    : config_(std::move(config)),
      hand_(std::move(hand)),
      encoder_error_m_(encoder_error_of(config_)),
      workspace_low_m_(to_eigen(config_.arm.workspace.low_m)),
      workspace_high_m_(to_eigen(config_.arm.workspace.high_m)) {}

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
  velocity_ = VelocityEstimator(velocity_window_);
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

  const Eigen::Vector3d position_m =
      arm_->measured_position_m() + encoder_error_m_ - encoder_offset_m_;
  sample.host_time = command.cycle_time;
  sample.device_time =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(arm_->time_s()));
  sample.pose = {to_driver(position_m), {}};
  sample.twist = {to_driver(velocity_.update(position_m, arm_->time_s())), {}};
  sample.wrench_applied = {to_driver(arm_->applied_newton()), {}};
  const std::uint32_t buttons = arm_->is_button_pressed() ? 1 : 0;
  if (std::exchange(sample.buttons, buttons) != buttons) ++sample.button_edges[0];
  if (arm_->is_saturated()) sample.faults.set(driver::Fault::kDeviceSaturated);
  if (arm_->is_at_stop() || !is_in_workspace(position_m))
    sample.faults.set(driver::Fault::kOutsideWorkspace);
  return driver::ExchangeStatus::kOk;
}

void SimDriver::deactivate() noexcept {
  arm_.reset();
}

bool SimDriver::is_in_workspace(const Eigen::Vector3d& position_m) const noexcept {
  // Uncalibrated encoders may show positions beyond the stops.
  const double tolerance_m = config_.encoder_error_m + config_.arm.resolution_m;
  return (position_m.array() >= workspace_low_m_.array() - tolerance_m).all() &&
         (position_m.array() <= workspace_high_m_.array() + tolerance_m).all();
}

std::vector<driver::ParameterSpec> SimDriver::parameters() const {
  using driver::ParameterType;
  constexpr double kOffsetMax = EncoderOffsetCalibration::kOffsetMaxMetres;
  const Eigen::Vector3d low_m = to_eigen(config_.arm.workspace.low_m);
  const Eigen::Vector3d high_m = to_eigen(config_.arm.workspace.high_m);
  driver::ParameterSpec workspace{.name = "workspace.low_m",
                                  .type = ParameterType::kVector,
                                  .unit = "m",
                                  .low = low_m.minCoeff(),
                                  .high = high_m.maxCoeff(),
                                  .vector_size = 3,
                                  .default_value = elements_of(low_m),
                                  .description =
                                      "Low corner; beyond it a sample has the fault "
                                      "'outside the workspace'."};
  driver::ParameterSpec workspace_high = workspace;
  workspace_high.name = "workspace.high_m";
  workspace_high.default_value = elements_of(high_m);
  workspace_high.description = "High corner, likewise.";
  return {{.name = "encoder.offset_m",
           .type = ParameterType::kVector,
           .unit = "m",
           .low = -kOffsetMax,
           .high = kOffsetMax,
           .vector_size = 3,
           .default_value = std::vector<double>{0, 0, 0},
           .description = "What the encoders read in the home position; positions are less that."},
          {.name = "encoder.resolution_m",
           .unit = "m",
           .low = 0,
           .default_value = config_.arm.resolution_m,
           .description = "Step of the encoders.",
           .mutability = driver::Mutability::kReadOnly},
          {.name = "velocity.cycle_count",
           .type = ParameterType::kInteger,
           .low = 1,
           .high = VelocityEstimator::kWindow,
           .default_value = std::int64_t{VelocityEstimator::kWindow},
           .description = "The velocity is the mean over so many cycles.",
           .mutability = driver::Mutability::kInactive},
          std::move(workspace),
          std::move(workspace_high)};
}

expected<void, SetupError> SimDriver::set_parameters(std::span<driver::ParameterSetting> settings) {
  Eigen::Vector3d low_m = workspace_low_m_;
  Eigen::Vector3d high_m = workspace_high_m_;
  take_vector(settings, "workspace.low_m", low_m);
  take_vector(settings, "workspace.high_m", high_m);
  if ((low_m.array() > high_m.array()).any()) {
    return setup_error("workspace.low_m is above workspace.high_m in a direction", "",
                       "give both corners, the low one below the high one");
  }
  workspace_low_m_ = low_m;
  workspace_high_m_ = high_m;
  const Eigen::Vector3d offset_before_m = encoder_offset_m_;
  take_vector(settings, "encoder.offset_m", encoder_offset_m_);
  // A new encoder offset shifts the position without a movement.
  if (encoder_offset_m_ != offset_before_m) velocity_ = VelocityEstimator(velocity_window_);
  auto window = static_cast<std::int64_t>(velocity_window_);
  take(settings, "velocity.cycle_count", window);
  velocity_window_ = static_cast<std::size_t>(window);
  return {};
}

std::vector<driver::CalibrationInfo> SimDriver::calibrations() const {
  return {{"encoder_offset", "Finds encoder.offset_m: put the arm at rest in its home position."},
          {"workspace", "Finds workspace.low_m and high_m: move the arm through all corners."}};
}

std::unique_ptr<driver::Calibration> SimDriver::make_calibration(std::string_view name) {
  if (name == "encoder_offset") {
    return std::make_unique<EncoderOffsetCalibration>(encoder_offset_m_);
  }
  if (name != "workspace") return nullptr;
  return std::make_unique<WorkspaceCalibration>(to_eigen(config_.arm.workspace.low_m).minCoeff(),
                                                to_eigen(config_.arm.workspace.high_m).maxCoeff());
}

}  // namespace rtpm::device_sim
