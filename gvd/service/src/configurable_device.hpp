#pragma once

#include "cycle.hpp"
#include "rtpm/configuration/configurable.hpp"

namespace rtpm::gvd {

/// The parameters and calibrations of a served device: its driver's, and the server's own.
/// @ownership refers to driver, descriptor and cycle, which must outlive it
class ConfigurableDevice final : public Configurable {
 public:
  ConfigurableDevice(driver::Driver& driver, const driver::Descriptor& descriptor,
                     DeviceCycle& cycle);

  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept override {
    return descriptor_;
  }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return parameters_;
  }
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return calibrations_;
  }
  [[nodiscard]] expected<void, ConfigurationError> apply(
      std::span<driver::ParameterSetting> settings, bool needs_inactive) override;
  [[nodiscard]] expected<std::unique_ptr<driver::Calibration>, ConfigurationError> make_calibration(
      std::string_view name) override;
  [[nodiscard]] bool is_active() const noexcept override {
    return cycle_.lifecycle() == driver::Lifecycle::kActive;
  }
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept override {
    return cycle_.newest();
  }

 private:
  [[nodiscard]] expected<void, ConfigurationError> change(
      std::span<driver::ParameterSetting> settings, bool needs_inactive);

  driver::Driver& driver_;
  const driver::Descriptor& descriptor_;
  DeviceCycle& cycle_;
  std::vector<driver::ParameterSpec> parameters_{};
  std::vector<driver::CalibrationInfo> calibrations_{};
};

}  // namespace rtpm::gvd
