#pragma once

#include <array>
#include <cstddef>
#include <Eigen/Core>
#include <optional>

#include "rtpm/base/time.hpp"
#include "rtpm/device_sim/hand.hpp"
#include "rtpm/driver/descriptor.hpp"

namespace rtpm::device_sim {

/// The mechanics and electronics of the simulated arm. The defaults lie between the desktop arms
/// that laboratories have.
struct ArmConfig {
  double mass_kg = 0.15;                ///< Of what moves, seen at the end effector.
  double damping_newton_s_per_m = 2.5;  ///< Of joints and transmission.
  double force_newton_max = 9.0;        ///< Beyond it the motors saturate.
  double resolution_m = 30e-6;          ///< The step of the encoders at the end effector.
  driver::Workspace workspace{{-0.10, -0.10, -0.10}, {0.10, 0.10, 0.10}};
};

/// A point mass in three directions that motors and, if there is one, a hand push, between the
/// stops of its workspace. It reads no clock: its time is the sum of the steps that it was given.
/// Ownership: a value.   Threads: one at a time.   RT: alloc-free.
class Arm {
 public:
  /// The longest time that one step() moves it; of a longer pause the rest is left out, for the arm
  /// and its hand alike.
  static constexpr Duration kStepMax = std::chrono::milliseconds{20};

  explicit Arm(const ArmConfig& config) noexcept : config_(config) {}
  /// With a hand, it begins where the hand is.
  Arm(const ArmConfig& config, Hand hand);

  /// Moves it for `elapsed` under `command_newton`, which it first limits to what the motors give,
  /// keeping its direction; a negative time counts as none, a command that is not finite as zero.
  /// Implicit Euler in slices of at most 1 ms: stable for any step and stiffness.
  void step(const Eigen::Vector3d& command_newton, Duration elapsed) noexcept;

  /// Where it really is and how fast it moves, finer than the encoders say.
  [[nodiscard]] const Motion& motion() const noexcept { return motion_; }
  /// What the encoders say.
  [[nodiscard]] Eigen::Vector3d measured_position_m() const noexcept;
  /// What the motors gave in the last step, and whether that was less than commanded.
  [[nodiscard]] const Eigen::Vector3d& applied_newton() const noexcept { return applied_newton_; }
  [[nodiscard]] bool is_saturated() const noexcept { return is_saturated_; }
  /// What the hand gave in the last slice.
  [[nodiscard]] const Eigen::Vector3d& hand_newton() const noexcept { return hand_newton_; }
  [[nodiscard]] bool is_at_stop() const noexcept { return is_at_stop_; }
  [[nodiscard]] bool is_button_pressed() const noexcept {
    return hand_ && hand_->is_pressing_at(time_s_);
  }
  /// Its own time since the begin.
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

/// Velocity as a real device has it: from measured positions only, as the mean over the last eight
/// steps, so that one encoder step is not mistaken for a jump.
/// Ownership: a value.   RT: alloc-free.
class VelocityEstimator {
 public:
  static constexpr std::size_t kWindow = 8;

  /// Takes the position measured at `time_s` and gives the velocity in m/s; zero for the first. A
  /// time that did not grow changes nothing.
  Eigen::Vector3d update(const Eigen::Vector3d& position_m, double time_s) noexcept;

 private:
  struct Point {
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
    double time_s = 0;
  };
  std::array<Point, kWindow + 1> points_{};
  std::size_t count_ = 0;
  Eigen::Vector3d velocity_m_per_s_ = Eigen::Vector3d::Zero();
};

}  // namespace rtpm::device_sim
