#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <utility>
#include <variant>

#include "rtpm/device_sim/trajectory.hpp"

namespace rtpm::device_sim {

/// The target of a hand without a recording: a slow figure in x and y that presses through the
/// plane z = 0 every two seconds, with a person's tremor (about 10 Hz, 0.1 mm) whose phase depends
/// on a seed.
/// @ownership a value
/// @realtime alloc-free
class PressingPath {
 public:
  explicit PressingPath(std::uint64_t seed) noexcept;
  /// The motion `time_s` seconds after the start; depends only on the seed and the time.
  [[nodiscard]] Motion at(double time_s) const noexcept;

 private:
  Eigen::Vector3d tremor_phase_rad_;
};

/// How a hand holds the end effector.
struct HandConfig {
  double stiffness_newton_per_m = 300;
  double damping_newton_s_per_m = 3;
  double force_newton_max = 30;  ///< Limit for the force of spring and damper.
};

/// A hand: a spring and a damper between the end effector and a target that moves along a path.
/// @ownership a value; copies share the immutable recording
/// @realtime alloc-free
class Hand {
 public:
  Hand(const HandConfig& config, PressingPath path) : config_(config), path_(path) {}
  Hand(const HandConfig& config, Trajectory path)
      : config_(config), path_(std::make_shared<const Trajectory>(std::move(path))) {}

  [[nodiscard]] const HandConfig& config() const noexcept { return config_; }
  /// The target `time_s` seconds after the start.
  [[nodiscard]] Motion target_at(double time_s) const noexcept;
  /// Whether the hand presses the button: for 0.2 s every 2 s, never in a recording.
  [[nodiscard]] bool is_pressing_at(double time_s) const noexcept;

 private:
  HandConfig config_;
  std::variant<PressingPath, std::shared_ptr<const Trajectory>> path_;
};

}  // namespace rtpm::device_sim
