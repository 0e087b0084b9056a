#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// A board that makes stimuli and senses them: outputs "flash", "beep" and "tap"; analogs
/// "photodiode" and "microphone", and the button "key", each of which follows its output after a
/// delay, as a screen, a loudspeaker and a hammer do.
class StimulusDriver final : public Twin {
 public:
  explicit StimulusDriver(TwinConfig twin) : Twin(std::move(twin)) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;

 private:
  static constexpr std::size_t kCount = 3;
  struct Channel {
    double delay_s;
    float output = 0;
    double changed_s = 0;  ///< When the output changed.
    float sensed = 0;
  };

  void reset() noexcept override;
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;

  std::array<Channel, kCount> channels_{{{.delay_s = 12e-3}, {.delay_s = 5e-3}, {.delay_s = 2e-3}}};
};

}  // namespace rtpm::device_sim
