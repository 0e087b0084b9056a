#include "rtpm/device_sim/hand.hpp"

#include <cmath>
#include <numbers>

namespace rtpm::device_sim {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kPressHz = 0.5;
constexpr double kPressMiddleMetres = 0.005;
constexpr double kPressReachMetres = 0.020;
constexpr double kFigureHz = 0.11;
constexpr double kFigureReachMetres = 0.025;
constexpr double kTremorHz = 9.7;
constexpr double kTremorReachMetres = 0.0001;
constexpr double kButtonPeriodSeconds = 2.0;
constexpr double kButtonPressSeconds = 0.2;

/// A number in [0, 1) that depends only on `seed` and `index`. Source: the finaliser of SplitMix64.
double fraction_of(std::uint64_t seed, std::uint64_t index) noexcept {
  std::uint64_t mixed = seed + (index + 1) * 0x9e3779b97f4a7c15ULL;
  mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9ULL;
  mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebULL;
  mixed ^= mixed >> 31;
  return static_cast<double>(mixed >> 11) * 0x1.0p-53;
}

/// Adds reach · sin(2π · hz · time + phase) and its derivative to one coordinate.
void add_swing(Motion& motion, Eigen::Index axis, double reach_m, double hz, double time_s,
               double phase_rad) noexcept {
  const double angle_rad = kTurn * hz * time_s + phase_rad;
  motion.position_m[axis] += reach_m * std::sin(angle_rad);
  motion.velocity_m_per_s[axis] += reach_m * kTurn * hz * std::cos(angle_rad);
}

}  // namespace

PressingPath::PressingPath(std::uint64_t seed) noexcept
    : tremor_phase_rad_(kTurn * fraction_of(seed, 0), kTurn * fraction_of(seed, 1),
                        kTurn * fraction_of(seed, 2)) {}

Motion PressingPath::at(double time_s) const noexcept {
  Motion motion;
  motion.position_m.z() = kPressMiddleMetres;
  // The path starts at the top of a stroke, away from the plane.
  add_swing(motion, 2, kPressReachMetres, kPressHz, time_s, kTurn / 4);
  add_swing(motion, 0, kFigureReachMetres, kFigureHz, time_s, 0);
  add_swing(motion, 1, kFigureReachMetres, 2 * kFigureHz, time_s, 0);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    add_swing(motion, axis, kTremorReachMetres, kTremorHz, time_s, tremor_phase_rad_[axis]);
  }
  return motion;
}

Motion Hand::target_at(double time_s) const noexcept {
  if (const auto* path = std::get_if<PressingPath>(&path_)) return path->at(time_s);
  return std::get<1>(path_)->at(time_s);
}

bool Hand::is_pressing_at(double time_s) const noexcept {
  return std::holds_alternative<PressingPath>(path_) &&
         std::fmod(time_s, kButtonPeriodSeconds) < kButtonPressSeconds;
}

}  // namespace rtpm::device_sim
