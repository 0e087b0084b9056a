#include "rtpm/device_falcon/falcon_driver.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/device_falcon/start_up.hpp"
#include "rtpm/device_io/buttons.hpp"
#include "rtpm/driver/vector.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_falcon {
namespace {

constexpr const char* kScaleName = "motor.counts_per_newton_metre";
constexpr std::size_t kHomedAnalog = 0;
constexpr Duration kPatience = std::chrono::milliseconds{1};

bool is_in_workspace(const driver::Vector3& position_m) noexcept {
  return std::max({std::abs(position_m.x), std::abs(position_m.y), std::abs(position_m.z)}) <
         FalconDriver::kRadiusMetres;
}

}  // namespace

FalconDriver::FalconDriver(FalconConfig config, OpenTransport open)
    : config_(std::move(config)), open_(std::move(open)) {}

FalconDriver::~FalconDriver() {
  FalconDriver::deactivate();
}

driver::Descriptor FalconDriver::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kHaptic;
  descriptor.model = "Novint Falcon";
  descriptor.serial = config_.serial;
  descriptor.frame = config_.frame;
  for (const char* name : {"x", "y", "z"}) {
    descriptor.axes.push_back({.name = name, .is_sensed = true, .is_actuated = true});
  }
  descriptor.buttons = {"plus", "forward", "centre", "minus"};
  descriptor.analogs = {{.name = "homed", .unit = "1"}};
  descriptor.modes = {driver::CommandMode::kForce};
  descriptor.limits = {.force_newton_max = kForceMaxNewton,
                       .stiffness_newton_per_m_max = 3000,
                       .damping_newton_s_per_m = 20};
  descriptor.workspace = {.low_m = {-kRadiusMetres, -kRadiusMetres, -kRadiusMetres},
                          .high_m = {kRadiusMetres, kRadiusMetres, kRadiusMetres}};
  descriptor.position_resolution_m = kResolutionMetres;
  return descriptor;
}

expected<void, SetupError> FalconDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("the Falcon's driver needs a period above zero", "", "set --rate");
  }
  deactivate();
  auto transport = open_();
  if (!transport) return unexpected{transport.error()};
  if (auto started = start_up(**transport, config_.firmware); !started) {
    return unexpected{started.error()};
  }
  transport_ = std::move(*transport);
  return {};
}

expected<void, SetupError> FalconDriver::activate() {
  if (!transport_ || is_active_) return setup_error("the Falcon's driver is not configured");
  session_.emplace(*transport_);
  // Waits so that the first exchange() has a sample and knows whether the unit is homed.
  while (session_->state().report_count < Session::kHomedPacketCount) {
    if (session_->step({}, kPatience)) continue;
    session_->stop();
    session_.reset();
    return setup_error("the Falcon's packets can't be used",
                       "none came, or they say that the grip is where it can't be",
                       "switch its power off and on again");
  }
  seen_corrupt_count_ = session_->state().corrupt_count;
  seen_edges_ = session_->state().button_edges;
  requests_.write({});
  report(false);
  if (auto started = thread_.start(config_.thread, [this] { return step(); }); !started) {
    session_->stop();
    session_.reset();
    return unexpected{started.error()};
  }
  is_active_ = true;
  return {};
}

bool FalconDriver::step() noexcept {
  const bool is_alive = session_->step(requests_.read().value_or(ForceRequest{}), kPatience);
  if (!is_alive) session_->stop();
  report(!is_alive);
  return is_alive;
}

void FalconDriver::report(bool is_gone) noexcept {
  reports_.write({session_->state(), rt::now(), session_->is_late(), is_gone});
}

MotorForce FalconDriver::force_for(const driver::Command& command,
                                   const FalconState& state) const noexcept {
  if (command.mode != driver::CommandMode::kForce) return {};
  const driver::Vector3& wanted = command.wrench.force_newton;
  if (!state.is_homed) return {.is_saturated = wanted != driver::Vector3{}};
  return motor_force(wanted, state.position_m, kForceMaxNewton, counts_per_newton_metre_);
}

driver::ExchangeStatus FalconDriver::exchange(const driver::Command& command,
                                              driver::Sample& sample) noexcept {
  if (!is_active_) return driver::ExchangeStatus::kGone;
  const auto report = reports_.read();
  if (!report) return driver::ExchangeStatus::kLate;
  const MotorForce force = force_for(command, report->state);
  requests_.write(
      {.number = ++request_number_, .counts = force.counts, .deadline = command.deadline});
  if (report->is_gone) return driver::ExchangeStatus::kGone;
  const std::uint64_t corrupt_count = report->state.corrupt_count;
  if (std::exchange(seen_corrupt_count_, corrupt_count) != corrupt_count) {
    return driver::ExchangeStatus::kCorrupt;
  }
  if (report->is_late || rt::now() - report->reported_at > kStuckAfter) {
    return driver::ExchangeStatus::kLate;
  }
  fill(sample, report->state, force);
  return driver::ExchangeStatus::kOk;
}

void FalconDriver::fill(driver::Sample& sample, const FalconState& state,
                        const MotorForce& force) noexcept {
  sample.host_time = std::max(sample.host_time, state.time);
  sample.twist = {};
  if (state.is_homed) {
    sample.pose = {difference(state.position_m, kCentreMetres), {}};
    sample.twist.linear_m_per_s = state.velocity_m_per_s;
  }
  sample.wrench_applied = {force.applied_newton, {}};
  sample.analogs[kHomedAnalog] = state.is_homed ? 1 : 0;
  device_io::take_buttons(sample, state.buttons, seen_edges_, state.button_edges);
  seen_edges_ = state.button_edges;
  if (force.is_saturated) sample.faults.set(driver::Fault::kDeviceSaturated);
  if (!state.is_homed || !is_in_workspace(sample.pose.position_m)) {
    sample.faults.set(driver::Fault::kOutsideWorkspace);
  }
}

void FalconDriver::deactivate() noexcept {
  thread_.stop();
  is_active_ = false;
  if (session_) session_->stop();
  session_.reset();
  transport_.reset();
}

std::vector<driver::ParameterSpec> FalconDriver::parameters() const {
  return {{.name = kScaleName,
           .unit = "1/(N·m)",
           .low = 1000,
           .high = 100'000,
           .default_value = kCountsPerNewtonMetre,
           .description = "Motor counts per torque of a leg, to be found with a force gauge.",
           .mutability = driver::Mutability::kInactive}};
}

expected<void, SetupError> FalconDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  for (const driver::ParameterSetting& setting : settings) {
    if (setting.name == kScaleName) counts_per_newton_metre_ = std::get<double>(setting.value);
  }
  return {};
}

}  // namespace rtpm::device_falcon
