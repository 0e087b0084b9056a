// A device of your own as a plug-in: a pendulum with a motor. Its hardware is simulated in
// exchange(); yours would write and read a port there. First: rtpm up examples/laboratory.toml
//
//     rtpm-deviced --check driver_plugin.so
//     rtpm-deviced --devices pendulum --device-pendulum-driver driver_plugin.so
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string_view>

#include "rtpm/driver/plugin.hpp"

namespace {

using rtpm::driver::CommandMode;
using rtpm::driver::ExchangeStatus;

constexpr double kTorqueMaxNewtonM = 0.5;
constexpr double kInertiaKgM2 = 2e-3;  // 0.2 kg at the end of 0.1 m.
constexpr double kGravityNewtonM = 0.2;
constexpr double kFrictionNewtonMSPerRad = 1e-3;

class PendulumDriver final : public rtpm::driver::Driver {
 public:
  /// The safety filter uses these limits: state what the maker guarantees.
  [[nodiscard]] rtpm::driver::Descriptor describe() const override {
    rtpm::driver::Descriptor descriptor;
    descriptor.device_class = rtpm::driver::DeviceClass::kDial;
    descriptor.model = "Example pendulum";
    descriptor.serial = "pendulum-1";
    descriptor.frame = "pendulum/base";
    descriptor.joints = {{.name = "angle",
                          .unit = "rad",
                          .low = -std::numbers::pi,
                          .high = std::numbers::pi,
                          .velocity_max = 50,
                          .effort_max = kTorqueMaxNewtonM}};
    descriptor.modes = {CommandMode::kJointEffort};
    descriptor.rate_hz = 1000;
    return descriptor;
  }

  /// Opens the hardware. An error is a sentence with its cause and remedy.
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(
      const rtpm::driver::DriverConfig& config) override {
    if (config.period <= rtpm::Duration{0})
      return rtpm::setup_error("the pendulum needs a period above zero", "", "set its rate");
    period_s_ = std::chrono::duration<double>(config.period).count();
    return {};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override {
    is_active_ = true;
    return {};
  }

  /// One cycle in real time: no allocation, no lock, no wait.
  [[nodiscard]] ExchangeStatus exchange(const rtpm::driver::Command& command,
                                        rtpm::driver::Sample& sample) noexcept override {
    if (!is_active_) return ExchangeStatus::kGone;
    const double wanted = command.mode == CommandMode::kJointEffort ? command.joints[0] : 0;
    // The safety filter has limited it. A driver limits it again before it drives a motor.
    const double torque =
        std::isfinite(wanted) ? std::clamp(wanted, -kTorqueMaxNewtonM, kTorqueMaxNewtonM) : 0;
    velocity_ +=
        period_s_ / kInertiaKgM2 *
        (torque - kGravityNewtonM * std::sin(angle_) - kFrictionNewtonMSPerRad * velocity_);
    angle_ = std::remainder(angle_ + period_s_ * velocity_, 2 * std::numbers::pi);
    sample.host_time = command.cycle_time;
    sample.joints[0] = angle_;
    sample.joint_velocities[0] = velocity_;
    sample.efforts_applied[0] = torque;
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override { is_active_ = false; }

 private:
  double period_s_ = 1e-3;
  double angle_ = 1;  ///< In rad from where it hangs; it swings from there.
  double velocity_ = 0;
  bool is_active_ = false;
};

rtpm::expected<std::unique_ptr<rtpm::driver::Driver>, rtpm::SetupError> make_pendulum(
    std::string_view arguments) {
  // The operator's --device-pendulum-arguments; this device has none.
  if (!arguments.empty())
    return rtpm::setup_error("the pendulum takes no arguments", "", "leave them out");
  return std::make_unique<PendulumDriver>();
}

}  // namespace

RTPM_DRIVER_PLUGIN(&make_pendulum);
