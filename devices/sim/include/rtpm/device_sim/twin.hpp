#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/driver/driver.hpp"

namespace rtpm::device_sim {

/// The identity of a simulated device.
struct TwinConfig {
  std::string serial = "sim-1";
  std::string frame = "sim/base";
  std::uint64_t seed = 1;  ///< Equal seeds give equal samples.
};

/// Base class of simulated devices without spatial forces: a life cycle, and a time that is the sum
/// of the cycle durations. The same commands at the same cycle times give the same samples, bit for
/// bit.
class Twin : public driver::Driver {
 public:
  /// The longest time simulated in one cycle; if a cycle is longer, the rest is skipped.
  static constexpr Duration kStepMax = std::chrono::milliseconds{20};

  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) final;
  [[nodiscard]] expected<void, SetupError> activate() final;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept final;
  void deactivate() noexcept final { is_active_ = false; }

 protected:
  explicit Twin(TwinConfig config) : config_(std::move(config)) {}

  /// Creates a descriptor with class, model, serial number and frame.
  [[nodiscard]] driver::Descriptor identity(driver::DeviceClass device_class,
                                            const char* model) const;
  /// Returns to the start state.
  virtual void reset() noexcept = 0;
  /// Advances by `elapsed_s`, from 0 to kStepMax, and fills in the measured values.
  virtual void step(const driver::Command& command, double elapsed_s,
                    driver::Sample& sample) noexcept = 0;

  /// The time since activate(), at the end of this step.
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const TwinConfig& config() const noexcept { return config_; }

 private:
  TwinConfig config_;
  Duration period_{};
  bool is_active_ = false;
  double time_s_ = 0;
  std::optional<MonotonicTime> last_cycle_{};
};

/// Sets button 0 and counts its edges.
void set_button(driver::Sample& sample, bool is_pressed) noexcept;

/// A number from 0 to 1 that depends only on `seed` and `index`.
[[nodiscard]] double random_share(std::uint64_t seed, std::uint64_t index) noexcept;

}  // namespace rtpm::device_sim
