#pragma once

#include <span>
#include <vector>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// A sensor on a resting person: analogs "pulse" (blood volume, 0 to 1), "heart_rate" (in Hz) and
/// "skin_conductance" (in S, with a response to a stimulus every few seconds).
class BiometricDriver final : public Twin {
 public:
  explicit BiometricDriver(TwinConfig twin) : Twin(std::move(twin)) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;

 private:
  void reset() noexcept override { beat_ = 0; }
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;

  // Parameters.
  double pulse_gain_ = 1;
  double rest_hz_ = 1.1;

  double beat_ = 0;  ///< Number of heart beats since the start.
};

}  // namespace rtpm::device_sim
