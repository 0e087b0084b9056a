#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/device_sim/arm.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_sim {

/// The simulated arm and its hand.
struct SimConfig {
  ArmConfig arm{};
  HandConfig hand{};
  bool is_held = true;      ///< If false, only the motors move the arm.
  std::string hand_file{};  ///< The file of a recorded hand; if empty, PressingPath is used.
  std::uint64_t seed = 1;   ///< The seed for PressingPath and the encoder errors.
  /// Maximum error of each encoder before it is calibrated.
  double encoder_error_m = 0;
  std::string serial = "sim-1";
  std::string frame = "arm0/base";
};

/// A simulated haptic arm with three degrees of freedom, as a driver. The same commands at the same
/// cycle times give the same samples, bit for bit. exchange() never waits; for ownership, threads
/// and real-time class see driver::Driver.
class SimDriver final : public driver::Driver {
 public:
  /// Checks the settings and reads the recording.
  /// @realtime set-up only
  /// @errors   those of Trajectory::load(); a setting that is not finite or not greater than zero
  [[nodiscard]] static expected<std::unique_ptr<SimDriver>, SetupError> create(SimConfig config);

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  /// Resets the arm to its start state: at the hand, at rest.
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override;
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

  /// The simulated arm, for tests and displays; nullopt before activate().
  [[nodiscard]] const std::optional<Arm>& arm() const noexcept { return arm_; }

 private:
  SimDriver(SimConfig config, std::optional<Hand> hand);
  [[nodiscard]] bool is_in_workspace(const Eigen::Vector3d& position_m) const noexcept;

  SimConfig config_;
  std::optional<Hand> hand_;
  Eigen::Vector3d encoder_error_m_;
  // The parameters.
  Eigen::Vector3d encoder_offset_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d workspace_low_m_;
  Eigen::Vector3d workspace_high_m_;
  std::size_t velocity_window_ = VelocityEstimator::kWindow;

  Duration period_{};
  std::optional<Arm> arm_{};
  VelocityEstimator velocity_{};
  std::optional<MonotonicTime> last_cycle_{};
};

}  // namespace rtpm::device_sim
