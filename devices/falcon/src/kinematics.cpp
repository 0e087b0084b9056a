#include "rtpm/device_falcon/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <numbers>

namespace rtpm::device_falcon {
namespace {

constexpr double kRadianPerDegree = std::numbers::pi / 180;
/// The angle at which an encoder reads zero.
constexpr double kZeroCountsRadian = 35 * kRadianPerDegree;

// The lengths of the mechanism in metres, named by the letters in the source.
constexpr double kA = 0.060;
constexpr double kB = 0.1025;
constexpr double kC = 0.01443;
constexpr double kD = 0.01125;
constexpr double kE = 0.01125;
constexpr double kF = -0.025;
constexpr double kR = 0.0400;
constexpr double kS = -0.02309;

constexpr int kNewtonStepMax = 10;
constexpr double kNewtonRadian = 1e-9;
/// If Newton's method makes a larger step, it has left the workspace.
constexpr double kReachMetres = 0.5;
/// If the pivot is smaller, the legs are so close to a singular pose that forces are meaningless.
constexpr double kSmallestPivot = 1e-6;

struct LegDirection {
  double cosine;
  double sine;
};

const std::array<LegDirection, 3>& leg_directions() noexcept {
  static const auto kDirections = [] {
    std::array<LegDirection, 3> directions{};
    constexpr std::array kDegrees{105.0, -15.0, -135.0};
    for (std::size_t leg = 0; leg < 3; ++leg) {
      const double radian = kDegrees[leg] * kRadianPerDegree;
      directions[leg] = {std::cos(radian), std::sin(radian)};
    }
    return directions;
  }();
  return kDirections;
}

Eigen::Matrix3d to_eigen(const Matrix3& rows) noexcept {
  Eigen::Matrix3d matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      matrix(row, column) = rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
    }
  }
  return matrix;
}

Eigen::Vector3d to_eigen(const driver::Vector3& vector) noexcept {
  return {vector.x, vector.y, vector.z};
}
driver::Vector3 to_driver(const Eigen::Vector3d& vector) noexcept {
  return {vector.x(), vector.y(), vector.z()};
}

/// Sets the angles of one leg; returns false if the leg can't reach the position.
bool invert_leg(const LegDirection& leg, const driver::Vector3& at, double& upper, double& lower,
                double& sideways) noexcept {
  const double u = leg.cosine * at.x + leg.sine * at.y - kR;
  const double v = -leg.sine * at.x + leg.cosine * at.y - kS;
  const double w = at.z;
  const double sideways_cosine = (v + kF) / kB;
  // This form of the condition also rejects NaN.
  if (!(std::abs(sideways_cosine) < 1)) return false;
  sideways = std::acos(sideways_cosine);
  const double length = kD + kE + kB * std::sin(sideways);
  const double l0 = (u + kC - kA) * (u + kC - kA) + w * w - length * length;
  const double l1 = -4 * kA * w;
  const double l2 = (u + kC + kA) * (u + kC + kA) + w * w - length * length;
  const double root = l1 * l1 - 4 * l0 * l2;
  if (!(root >= 0) || l2 == 0) return false;
  upper = 2 * std::atan((-l1 - std::sqrt(root)) / (2 * l2));
  const double lower_cosine = (u - kA * std::cos(upper) + kC) / length;
  if (!(std::abs(lower_cosine) <= 1)) return false;
  lower = std::acos(lower_cosine);
  return std::isfinite(upper);
}

/// `force`, reduced to the length `longest` in the same direction.
Eigen::Vector3d shortened(const Eigen::Vector3d& force, double longest) noexcept {
  // In two steps, because the square of a large number overflows.
  const double scale = force.cwiseAbs().maxCoeff();
  if (scale <= longest && force.norm() <= longest) return force;
  return (force / scale).normalized() * longest;
}

}  // namespace

std::array<double, 3> upper_angles(const LegCounts& counts) noexcept {
  std::array<double, 3> upper{};
  for (std::size_t leg = 0; leg < 3; ++leg)
    upper[leg] = kZeroCountsRadian + counts[leg] * kRadianPerCount;
  return upper;
}

std::array<double, 3> encoder_counts(const std::array<double, 3>& upper) noexcept {
  std::array<double, 3> counts{};
  for (std::size_t leg = 0; leg < 3; ++leg)
    counts[leg] = (upper[leg] - kZeroCountsRadian) / kRadianPerCount;
  return counts;
}

std::optional<LegAngles> inverse(const driver::Vector3& position_m) noexcept {
  LegAngles angles;
  for (std::size_t leg = 0; leg < 3; ++leg) {
    if (!invert_leg(leg_directions()[leg], position_m, angles.upper[leg], angles.lower[leg],
                    angles.sideways[leg])) {
      return std::nullopt;
    }
  }
  return angles;
}

Matrix3 jacobian(const LegAngles& angles) noexcept {
  Matrix3 rows{};
  for (std::size_t leg = 0; leg < 3; ++leg) {
    const LegDirection& direction = leg_directions()[leg];
    const double lower_sine = std::sin(angles.lower[leg]);
    const double lower_cosine = std::cos(angles.lower[leg]);
    const double sideways_sine = std::sin(angles.sideways[leg]);
    const double sideways_cosine = std::cos(angles.sideways[leg]);
    const double divisor = -kA * sideways_sine * std::sin(angles.upper[leg] - angles.lower[leg]);
    rows[leg] = {
        (direction.cosine * lower_cosine * sideways_sine - direction.sine * sideways_cosine) /
            divisor,
        (direction.sine * lower_cosine * sideways_sine + direction.cosine * sideways_cosine) /
            divisor,
        lower_sine * sideways_sine / divisor};
  }
  return rows;
}

std::optional<driver::Vector3> forward(const std::array<double, 3>& upper,
                                       const driver::Vector3& start_m) noexcept {
  Eigen::Vector3d at = to_eigen(start_m);
  Eigen::Vector3d step = Eigen::Vector3d::Zero();
  for (int attempt = 0; attempt <= kNewtonStepMax; ++attempt) {
    const auto angles = inverse(to_driver(at));
    if (!angles) {
      // The step exceeded the legs' reach: tries half of it.
      if (step.isZero(0)) return std::nullopt;
      step /= 2;
      at -= step;
      continue;
    }
    const Eigen::Vector3d error{upper[0] - angles->upper[0], upper[1] - angles->upper[1],
                                upper[2] - angles->upper[2]};
    if (error.cwiseAbs().maxCoeff() < kNewtonRadian) return to_driver(at);
    step = to_eigen(jacobian(*angles)).partialPivLu().solve(error);
    // This form of the condition also rejects NaN.
    if (!(step.cwiseAbs().maxCoeff() < kReachMetres)) return std::nullopt;
    at += step;
  }
  return std::nullopt;
}

MotorForce motor_force(const driver::Vector3& force_newton, const driver::Vector3& position_m,
                       double force_newton_max, double counts_per_newton_metre) noexcept {
  const Eigen::Vector3d asked = to_eigen(force_newton);
  if (!asked.allFinite()) return {.is_saturated = true};
  if (asked.isZero(0)) return {};
  const auto angles = inverse(position_m);
  if (!angles) return {.is_saturated = true};
  Eigen::Vector3d applied = shortened(asked, force_newton_max);
  // The work of the motors equals that of the force: torque = (Jacobian transposed)⁻¹ · force.
  const Eigen::Matrix3d transposed = to_eigen(jacobian(*angles)).transpose();
  const Eigen::PartialPivLU<Eigen::Matrix3d> solver(transposed);
  if (!(solver.rcond() > kSmallestPivot)) return {.is_saturated = true};
  Eigen::Vector3d counts = -counts_per_newton_metre * solver.solve(applied);
  const double largest = counts.cwiseAbs().maxCoeff();
  if (!std::isfinite(largest)) return {.is_saturated = true};
  if (largest > kMotorCountMax) {
    counts *= kMotorCountMax / largest;
    applied *= kMotorCountMax / largest;
  }
  MotorForce result{.applied_newton = to_driver(applied), .is_saturated = applied != asked};
  for (Eigen::Index leg = 0; leg < 3; ++leg) {
    result.counts[static_cast<std::size_t>(leg)] =
        static_cast<std::int16_t>(std::lround(counts[leg]));
  }
  return result;
}

driver::Vector3 force_of(const LegCounts& counts, const driver::Vector3& position_m,
                         double counts_per_newton_metre) noexcept {
  const auto angles = inverse(position_m);
  if (!angles) return {};
  const Eigen::Vector3d torque =
      Eigen::Vector3d(counts[0], counts[1], counts[2]) / -counts_per_newton_metre;
  return to_driver(to_eigen(jacobian(*angles)).transpose() * torque);
}

}  // namespace rtpm::device_falcon
