#pragma once

#include <memory>
#include <string>
#include <vector>

#include "library.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::driver_host {

/// Passes calls on to a plug-in's driver, and turns what it throws into errors. What is constant of
/// a driver was asked for once, when it was loaded.
/// @ownership keeps its library loaded, as each of its calibrations does
class PluginDriver final : public driver::Driver {
 public:
  PluginDriver(std::string file, std::shared_ptr<const Library> library,
               std::unique_ptr<Driver> driver, driver::Descriptor descriptor,
               std::vector<driver::ParameterSpec> parameters,
               std::vector<driver::CalibrationInfo> calibrations) noexcept;

  [[nodiscard]] driver::Descriptor describe() const override { return descriptor_; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override {
    return driver_->exchange(command, sample);
  }
  void deactivate() noexcept override { driver_->deactivate(); }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return parameters_;
  }
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return calibrations_;
  }
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

 private:
  std::string file_;
  std::shared_ptr<const Library> library_;  // Outlives its driver.
  std::unique_ptr<Driver> driver_;
  driver::Descriptor descriptor_;
  std::vector<driver::ParameterSpec> parameters_;
  std::vector<driver::CalibrationInfo> calibrations_;
};

}  // namespace rtpm::driver_host
