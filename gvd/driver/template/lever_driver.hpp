#pragma once

#include <optional>
#include <string>
#include <utility>

#include "rtpm/driver/driver.hpp"

namespace lab {

/// STEP 1: the handle of your device, and the buffers that exchange() needs, all allocated before
/// it runs.
struct LeverHardware {
  int encoder_count = 0;
  double motor_newton = 0;
  bool is_button_down = false;
  bool is_plugged_in = true;
};

/// A lever with one axis, one motor and one button: the template of a driver. Copy it, then follow
/// STEP 1 to STEP 7. Its "hardware" is the struct LeverHardware, so it runs unmodified and passes
/// the conformance suite.
class LeverDriver final : public rtpm::driver::Driver {
 public:
  /// @param port  the file of the lever's port, such as /dev/ttyACM0; if empty, a lever that is
  ///           always plugged in
  explicit LeverDriver(std::string port = {}) : port_(std::move(port)) {}

  [[nodiscard]] rtpm::driver::Descriptor describe() const override;
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(
      const rtpm::driver::DriverConfig& config) override;
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override;
  [[nodiscard]] rtpm::driver::ExchangeStatus exchange(
      const rtpm::driver::Command& command, rtpm::driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

 private:
  std::string port_;
  std::optional<LeverHardware> hardware_{};
};

}  // namespace lab
