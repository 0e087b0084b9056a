#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/device_sim/arm.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_sim {

/// The simulated arm and its hand.
struct SimConfig {
  ArmConfig arm{};
  HandConfig hand{};
  bool is_held = true;      ///< False: no hand, only the motors move it.
  std::string hand_file{};  ///< A recorded hand, see Trajectory; empty: PressingPath.
  std::uint64_t seed = 1;   ///< Of PressingPath.
  std::string serial = "sim-1";
  std::string frame = "arm0/base";
};

/// A simulated haptic arm of three degrees of freedom behind the driver interface. The same
/// commands at the same cycle times give the same samples, bit for bit. exchange() never waits;
/// for ownership, threads and real-time class see driver::Driver.
class SimDriver final : public driver::Driver {
 public:
  /// Checks the settings and reads the recording.
  /// @realtime set-up only
  /// @errors   as Trajectory::load(); a setting that is not finite or not above zero
  [[nodiscard]] static expected<std::unique_ptr<SimDriver>, SetupError> create(SimConfig config);

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  /// Resets the arm to its start: at the hand, at rest.
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

  /// The arm itself, for tests and displays; nothing before activate().
  [[nodiscard]] const std::optional<Arm>& arm() const noexcept { return arm_; }

 private:
  SimDriver(SimConfig config, std::optional<Hand> hand)
      : config_(std::move(config)), hand_(std::move(hand)) {}

  SimConfig config_;
  std::optional<Hand> hand_;
  Duration period_{};
  std::optional<Arm> arm_{};
  VelocityEstimator velocity_{};
  std::optional<MonotonicTime> last_cycle_{};
};

}  // namespace rtpm::device_sim
