#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <utility>
#include <variant>

#include "rtpm/device_sim/trajectory.hpp"

namespace rtpm::device_sim {

/// Where a hand wants to be when nobody recorded one: it draws a slow figure in x and y while it
/// presses down through the plane z = 0 and comes back every two seconds, with the tremor of a
/// person (about 10 Hz, a tenth of a millimetre) whose phases come from a seed.
/// Ownership: a value.   RT: alloc-free.
class PressingPath {
 public:
  explicit PressingPath(std::uint64_t seed) noexcept;
  /// The motion `time_s` seconds after the begin; the same for the same seed and time.
  [[nodiscard]] Motion at(double time_s) const noexcept;

 private:
  Eigen::Vector3d tremor_phase_rad_;
};

/// How a hand holds the end effector.
struct HandConfig {
  double stiffness_newton_per_m = 300;
  double damping_newton_s_per_m = 3;
  double force_newton_max = 30;  ///< It pulls no harder, however far away it wants to be.
};

/// A hand: a spring and a damper between the end effector and the point where the hand wants to be,
/// which moves along a path.
/// Ownership: a value; copies share the recording, which nothing changes.   RT: alloc-free.
class Hand {
 public:
  Hand(const HandConfig& config, PressingPath path) : config_(config), path_(path) {}
  Hand(const HandConfig& config, Trajectory path)
      : config_(config), path_(std::make_shared<const Trajectory>(std::move(path))) {}

  [[nodiscard]] const HandConfig& config() const noexcept { return config_; }
  /// Where it wants to be `time_s` seconds after the begin.
  [[nodiscard]] Motion target_at(double time_s) const noexcept;
  /// Whether its finger is on the button: for a fifth of a second every two, never in a recording.
  [[nodiscard]] bool is_pressing_at(double time_s) const noexcept;

 private:
  HandConfig config_;
  std::variant<PressingPath, std::shared_ptr<const Trajectory>> path_;
};

}  // namespace rtpm::device_sim
