#pragma once

#include <array>
#include <cstddef>
#include <Eigen/Core>
#include <optional>

#include "rtpm/base/time.hpp"
#include "rtpm/device_sim/hand.hpp"
#include "rtpm/driver/descriptor.hpp"

namespace rtpm::device_sim {

/// The mechanics and electronics of the simulated arm. The defaults are between those of common
/// desktop arms.
struct ArmConfig {
  double mass_kg = 0.15;                ///< The moving mass at the end effector.
  double damping_newton_s_per_m = 2.5;  ///< The damping of joints and transmission.
  double force_newton_max = 9.0;        ///< The motors saturate beyond this force.
  double resolution_m = 30e-6;          ///< The encoder step at the end effector.
  driver::Workspace workspace{{-0.10, -0.10, -0.10}, {0.10, 0.10, 0.10}};
};

/// A point mass that moves in three directions within the stops of its workspace, pushed by motors
/// and optionally a hand. It reads no clock: its time is the sum of its steps.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free
class Arm {
 public:
  /// The longest time simulated by one step(), for arm and hand; if a step is longer, the rest is
  /// skipped.
  static constexpr Duration kStepMax = std::chrono::milliseconds{20};

  explicit Arm(const ArmConfig& config) noexcept : config_(config) {}
  /// Starts at the position of the hand.
  Arm(const ArmConfig& config, Hand hand);

  /// Moves the arm for `elapsed` under `command_newton`, saturated to the motors' force in the same
  /// direction. A negative time counts as 0, a command that is not finite as zero.
  /// Implicit Euler in slices of at most 1 ms: stable for any step and stiffness.
  void step(const Eigen::Vector3d& command_newton, Duration elapsed) noexcept;

  /// The exact motion, without the encoders' quantization.
  [[nodiscard]] const Motion& motion() const noexcept { return motion_; }
  /// The position as the encoders measure it.
  [[nodiscard]] Eigen::Vector3d measured_position_m() const noexcept;
  /// The motors' force in the last step, and whether it was less than commanded.
  [[nodiscard]] const Eigen::Vector3d& applied_newton() const noexcept { return applied_newton_; }
  [[nodiscard]] bool is_saturated() const noexcept { return is_saturated_; }
  /// The hand's force in the last slice of a step.
  [[nodiscard]] const Eigen::Vector3d& hand_newton() const noexcept { return hand_newton_; }
  [[nodiscard]] bool is_at_stop() const noexcept { return is_at_stop_; }
  [[nodiscard]] bool is_button_pressed() const noexcept {
    return hand_ && hand_->is_pressing_at(time_s_);
  }
  /// The simulated time since the start.
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const ArmConfig& config() const noexcept { return config_; }

 private:
  void step_slice(double slice_s) noexcept;
  void stop_at_workspace() noexcept;

  ArmConfig config_;
  std::optional<Hand> hand_{};
  Motion motion_{};
  Eigen::Vector3d applied_newton_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d hand_newton_ = Eigen::Vector3d::Zero();
  double time_s_ = 0;
  bool is_saturated_ = false;
  bool is_at_stop_ = false;
};

/// Computes the velocity like a real device: from measured positions, as the mean over the last few
/// steps, which smooths the encoder steps.
/// @ownership a value
/// @realtime alloc-free
class VelocityEstimator {
 public:
  static constexpr std::size_t kWindow = 8;  ///< The maximum and the default.

  explicit VelocityEstimator(std::size_t window = kWindow) noexcept : window_(window) {}
  /// Adds the position measured at `time_s` and returns the velocity in m/s; zero for the first
  /// position. A time that has not increased changes nothing.
  Eigen::Vector3d update(const Eigen::Vector3d& position_m, double time_s) noexcept;

 private:
  struct Point {
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
    double time_s = 0;
  };
  std::size_t window_;  ///< From 1 to kWindow.
  std::array<Point, kWindow + 1> points_{};
  std::size_t count_ = 0;
  Eigen::Vector3d velocity_m_per_s_ = Eigen::Vector3d::Zero();
};

}  // namespace rtpm::device_sim
