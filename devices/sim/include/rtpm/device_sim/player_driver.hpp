#pragma once

#include <span>
#include <vector>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// A media player: output "rate" (1 plays, 0 pauses, negative plays backwards) and output "seek"
/// (seeks to this time when it changes; not if negative), analogs "position" and "rate". It stops
/// at both ends; with the parameter "loop" it continues at the other end. It also stops without a
/// command.
class PlayerDriver final : public Twin {
 public:
  static constexpr double kLengthSeconds = 60;

  explicit PlayerDriver(TwinConfig twin) : Twin(std::move(twin)) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;

 private:
  void reset() noexcept override;
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;

  // The parameters.
  bool is_looping_ = false;
  double rate_max_ = 4;

  double position_s_ = 0;
  float last_seek_s_ = -1;
};

}  // namespace rtpm::device_sim
