#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// The mechanics of the simulated knob and of the fingers that turn it.
struct KnobConfig {
  double inertia_kg_m2 = 1e-4;
  double damping_newton_metre_s_per_rad = 5e-4;
  double effort_newton_metre_max = 0.05;
  double hand_newton_metre = 0.004;  ///< The maximum torque of the fingers; 0 without a hand.
  double resolution_rad = 1e-4;      ///< The encoder step.
};

/// A motorised knob with inertia: joint "dial", which turns endlessly, and button "push". Fingers
/// turn it back and forth and push it for 0.1 s every 3 s. It can have evenly spaced mechanical
/// detents.
class KnobDriver final : public Twin {
 public:
  explicit KnobDriver(TwinConfig twin, KnobConfig knob = {}) : Twin(std::move(twin)), knob_(knob) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;

 private:
  void reset() noexcept override;
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;
  [[nodiscard]] double detent_newton_metre() const noexcept;
  [[nodiscard]] double hand_newton_metre() const noexcept;

  KnobConfig knob_;
  // The parameters.
  std::int64_t detent_count_ = 0;
  double detent_newton_metre_max_ = 0.01;

  double angle_rad_ = 0;
  double velocity_rad_per_s_ = 0;
};

}  // namespace rtpm::device_sim
