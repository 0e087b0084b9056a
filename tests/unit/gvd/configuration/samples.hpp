#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/configuration/configurable.hpp"

namespace rtpm::test {

/// One parameter of each type; "offset_m" is writable only while inactive, "firmware" is read-only.
inline std::vector<driver::ParameterSpec> sample_specs() {
  using driver::ParameterType;
  return {
      {.name = "filter.on", .type = ParameterType::kBool, .default_value = true},
      {.name = "filter.taps",
       .type = ParameterType::kInteger,
       .low = 1,
       .high = 16,
       .default_value = std::int64_t{8}},
      {.name = "safety.force_newton_max",
       .type = ParameterType::kReal,
       .unit = "newton",
       .low = 0,
       .high = 9,
       .default_value = 9.0,
       .description = "Greatest force."},
      {.name = "label", .type = ParameterType::kText, .default_value = std::string("arm")},
      {.name = "mode",
       .type = ParameterType::kChoice,
       .choices = {"slow", "fast"},
       .default_value = std::string("slow")},
      {.name = "encoder.offset_m",
       .type = ParameterType::kVector,
       .unit = "metre",
       .low = -0.1,
       .high = 0.1,
       .vector_size = 3,
       .default_value = std::vector<double>{0, 0, 0},
       .mutability = driver::Mutability::kInactive},
      {.name = "firmware",
       .type = ParameterType::kText,
       .default_value = std::string("1.2"),
       .mutability = driver::Mutability::kReadOnly},
  };
}

/// A calibration of the mean x over the requested number of samples, after a prompt: twice.
class MeanCalibration final : public driver::Calibration {
 public:
  driver::CalibrationState step(const driver::Sample& sample,
                                std::optional<std::string_view> answer) override {
    if (answer == "abort") return driver::CalibrationFailed{"the operator gave up; begin again"};
    if (answer) is_ready_ = true;
    if (!is_ready_) {
      return driver::CalibrationPrompt{0.5 * round_, "hold still", {"ready", "abort"}};
    }
    sum_ += sample.pose.position_m.x;
    is_ready_ = ++count_ % kSampleCount != 0;
    if (is_ready_) return driver::CalibrationRunning{0.25};
    if (++round_ == 1) return driver::CalibrationPrompt{0.5, "hold still", {"ready", "abort"}};
    return driver::CalibrationDone{{{"encoder.offset_m", std::vector<double>{sum_ / count_, 0, 0}}},
                                   "found it"};
  }

  static constexpr int kSampleCount = 3;

 private:
  bool is_ready_ = false;
  int round_ = 0;
  int count_ = 0;
  double sum_ = 0;
};

/// A device with the sample parameters, and a calibration "offset".
class SampleDevice : public gvd::Configurable {
 public:
  SampleDevice() {
    described.model = "test arm";
    described.serial = "t-1";
    for (const driver::ParameterSpec& spec : specs) {
      values.push_back({spec.name, spec.default_value});
    }
  }

  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept override { return described; }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override { return specs; }
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return {{"offset", "Finds the encoders' offset."}};
  }
  [[nodiscard]] expected<void, gvd::ConfigurationError> apply(
      std::span<driver::ParameterSetting> settings, bool needs_inactive) override {
    ++apply_count;
    if (error.outcome != gvd::ConfigurationOutcome::kDone) return unexpected{error};
    if (needs_inactive && active) {
      return unexpected{gvd::ConfigurationError{gvd::ConfigurationOutcome::kWrongState}};
    }
    if (read_back) {
      for (driver::ParameterSetting& setting : settings) {
        read_back(setting);
      }
    }
    for (const driver::ParameterSetting& setting : settings) {
      for (driver::ParameterSetting& value : values) {
        if (value.name == setting.name) value.value = setting.value;
      }
    }
    return {};
  }
  [[nodiscard]] expected<std::unique_ptr<driver::Calibration>, gvd::ConfigurationError>
  make_calibration(std::string_view) override {
    return std::unique_ptr<driver::Calibration>(std::make_unique<MeanCalibration>());
  }
  [[nodiscard]] bool is_active() const noexcept override { return active; }
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept override { return sample; }

  driver::Descriptor described{};
  std::vector<driver::ParameterSpec> specs = sample_specs();
  std::vector<driver::ParameterSetting> values{};  ///< The device's present values.
  std::function<void(driver::ParameterSetting&)> read_back{};
  gvd::ConfigurationError error{gvd::ConfigurationOutcome::kDone};
  std::optional<driver::Sample> sample{};
  bool active = false;
  int apply_count = 0;
};

}  // namespace rtpm::test
