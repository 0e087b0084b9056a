#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "rtpm/driver/driver.hpp"

namespace rtpm::test {

/// A simulated device that follows `script` and records its commands.
class ScriptedDriver : public driver::Driver {
 public:
  using Script = std::function<driver::ExchangeStatus(const driver::Command&, driver::Sample&)>;

  [[nodiscard]] driver::Descriptor describe() const override { return descriptor; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig&) override {
    ++configure_count;
    if (!configure_error.empty()) return setup_error(configure_error);
    if (is_reachable && !is_reachable()) return setup_error("the cable is out");
    return {};
  }
  [[nodiscard]] expected<void, SetupError> activate() override {
    is_active = true;
    return {};
  }
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override {
    ++exchange_count;
    last_command = command;
    sample.host_time = command.cycle_time;
    sample.wrench_applied = command.wrench;
    return script ? script(command, sample) : driver::ExchangeStatus::kOk;
  }
  void deactivate() noexcept override { is_active = false; }

  driver::Descriptor descriptor = describe_lever();
  Script script{};
  std::string configure_error{};
  std::function<bool()> is_reachable{};  ///< configure() calls it; always reachable if empty.
  driver::Command last_command{};
  int configure_count = 0;
  int exchange_count = 0;
  bool is_active = false;

 private:
  [[nodiscard]] static driver::Descriptor describe_lever() {
    driver::Descriptor descriptor;
    descriptor.device_class = driver::DeviceClass::kHaptic;
    descriptor.model = "scripted";
    descriptor.serial = "s-1";
    descriptor.frame = "scripted/base";
    descriptor.axes = {{"x", true, true}};
    descriptor.buttons = {"left", "right"};
    descriptor.analogs = {{"grip", "N", 0, 10}};
    descriptor.limits.force_newton_max = 8;
    descriptor.limits.torque_newton_metre_max = 0.5;
    descriptor.limits.stiffness_newton_per_m_max = 500;
    descriptor.limits.damping_newton_s_per_m = 1.5;
    descriptor.modes = {driver::CommandMode::kForce};
    descriptor.workspace = {{-1, -2, -3}, {1, 2, 3}};
    descriptor.position_resolution_m = 1e-5;
    return descriptor;
  }
};

}  // namespace rtpm::test
