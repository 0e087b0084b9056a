#include "lever_driver.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string_view>

#include "rtpm/driver/plugin.hpp"

namespace lab {
namespace {

using rtpm::driver::ExchangeStatus;

constexpr double kForceMaxNewton = 4.0;
constexpr double kCountMetres = 25e-6;  // Per encoder count.

}  // namespace

// STEP 2: describe the device. The safety filter uses these limits: state what the maker
// guarantees, not short-term maxima.
rtpm::driver::Descriptor LeverDriver::describe() const {
  rtpm::driver::Descriptor descriptor;
  descriptor.device_class = rtpm::driver::DeviceClass::kHaptic;
  descriptor.model = "Example lever";
  descriptor.serial = "lever-1";
  descriptor.frame = "lever/base";
  descriptor.axes = {{.name = "x", .is_sensed = true, .is_actuated = true}};
  descriptor.buttons = {"trigger"};
  descriptor.modes = {rtpm::driver::CommandMode::kForce};
  descriptor.limits.force_newton_max = kForceMaxNewton;
  descriptor.limits.damping_newton_s_per_m = 1.0;
  descriptor.limits.stiffness_newton_per_m_max = 600;
  descriptor.workspace = {{-0.05, 0, 0}, {0.05, 0, 0}};
  descriptor.rate_hz = 1000;
  descriptor.position_resolution_m = kCountMetres;
  return descriptor;
}

// STEP 3: find and open the device, load its firmware, set its rate. May take seconds, but must
// return: while the device is absent, it is called twice a second. Return errors in words, with the
// remedy.
rtpm::expected<void, rtpm::SetupError> LeverDriver::configure(
    const rtpm::driver::DriverConfig& config) {
  if (config.period <= rtpm::Duration{0}) {
    return rtpm::setup_error("the lever needs a period above zero", "", "set its rate");
  }
  std::error_code error;
  if (!port_.empty() && !std::filesystem::exists(port_, error)) {
    return rtpm::setup_error("the lever's port " + port_ + " is not there", "", "plug it in");
  }
  return {};
}

// STEP 4: allocate everything that exchange() uses.
rtpm::expected<void, rtpm::SetupError> LeverDriver::activate() {
  hardware_.emplace();
  return {};
}

// STEP 5: one cycle. Write the command, read the state, convert to SI units and the descriptor's
// frame. Do not allocate, lock, or wait longer than a fraction of the period. Do not trust data
// from the hardware: check lengths and ranges, and return kCorrupt.
ExchangeStatus LeverDriver::exchange(const rtpm::driver::Command& command,
                                     rtpm::driver::Sample& sample) noexcept {
  if (!hardware_ || !hardware_->is_plugged_in) return ExchangeStatus::kGone;
  const bool has_force = command.mode == rtpm::driver::CommandMode::kForce;
  const double wanted_newton = has_force ? command.wrench.force_newton.x : 0.0;
  // The safety filter has clamped it; clamp again before driving a motor.
  hardware_->motor_newton = std::isfinite(wanted_newton)
                                ? std::clamp(wanted_newton, -kForceMaxNewton, kForceMaxNewton)
                                : 0.0;

  sample.host_time = command.cycle_time;
  sample.pose.position_m = {hardware_->encoder_count * kCountMetres, 0, 0};
  sample.wrench_applied.force_newton = {hardware_->motor_newton, 0, 0};
  const std::uint32_t buttons = hardware_->is_button_down ? 1 : 0;
  if (buttons != sample.buttons) ++sample.button_edges[0];
  sample.buttons = buttons;
  if (hardware_->motor_newton != wanted_newton) {
    sample.faults.set(rtpm::driver::Fault::kDeviceSaturated);
  }
  return ExchangeStatus::kOk;
}

// STEP 6: motors off first, then close, even if the device is unplugged.
void LeverDriver::deactivate() noexcept {
  hardware_.reset();
}

}  // namespace lab

// STEP 7: create the driver from the operator's --device-NAME-arguments.
rtpm::expected<std::unique_ptr<rtpm::driver::Driver>, rtpm::SetupError> make_lever(
    std::string_view arguments) {
  return std::make_unique<lab::LeverDriver>(std::string(arguments));
}

RTPM_DRIVER_PLUGIN(&make_lever);
