#pragma once

#include <array>
#include <numbers>
#include <optional>

#include "rtpm/device_falcon/protocol.hpp"
#include "rtpm/driver/geometry.hpp"

/// The Falcon's parallel mechanism: three legs connect the base and the grip. Positions are in the
/// mechanism's frame: x to the operator's right, y up, z out of the device towards the operator,
/// origin in the base.
/// @source   geometry: libnifalcon's FalconGeometry.h; the Jacobian is derived from the closed loop
///           of each leg, because libnifalcon's z column is wrong
namespace rtpm::device_falcon {

using Matrix3 = std::array<std::array<double, 3>, 3>;  ///< The elements are the rows.

/// The angles of the legs, in radians.
struct LegAngles {
  std::array<double, 3> upper{};  ///< Angles of the driven arms, measured by the encoders.
  std::array<double, 3> lower{};  ///< Angles of the parallelograms within the plane of their leg.
  /// Angles of the parallelograms out of the plane of their leg.
  std::array<double, 3> sideways{};
};

/// Angle of the driven arm per encoder count: 1280 counts per turn of a drum with 14.25 mm, which
/// drives a drum with 110 mm.
inline constexpr double kRadianPerCount = 14.25 / 110 * 2 * std::numbers::pi / 1280;
/// The grip's z position when all encoders read zero.
inline constexpr double kZeroCountsZMetres = 0.13460243;
/// The centre of the workspace.
inline constexpr driver::Vector3 kCentreMetres{0, 0, 0.125};
/// The change of position per encoder count, along z.
inline constexpr double kResolutionMetres = 4.6e-5;

[[nodiscard]] std::array<double, 3> upper_angles(const LegCounts& counts) noexcept;
/// The inverse of upper_angles(), without rounding.
[[nodiscard]] std::array<double, 3> encoder_counts(const std::array<double, 3>& upper) noexcept;

/// The angles at a position; nullopt if a leg can't reach it or it is not finite.
/// @realtime alloc-free
[[nodiscard]] std::optional<LegAngles> inverse(const driver::Vector3& position_m) noexcept;

/// The derivatives of the upper angles by the position, in rad/m.
/// @realtime alloc-free
[[nodiscard]] Matrix3 jacobian(const LegAngles& angles) noexcept;

/// Finds the position for the given upper angles with Newton's method, starting at `start_m`, to
/// 1e-9 rad.
/// @return nullopt if it did not converge within 10 steps, so there is no such position nearby
/// @realtime alloc-free, at most 10 steps
[[nodiscard]] std::optional<driver::Vector3> forward(const std::array<double, 3>& upper,
                                                     const driver::Vector3& start_m) noexcept;

/// The motor commands and the resulting force.
struct MotorForce {
  LegCounts counts{};
  driver::Vector3 applied_newton{};
  bool is_saturated = false;  ///< Whether the force is smaller than requested.
};

/// The motor counts for a force at a position. A force greater than `force_newton_max`, or beyond a
/// motor's range, is reduced without changing its direction. The result is zero if the mechanism
/// can't reach the position or the force is not finite.
/// @param counts_per_newton_metre  greater than zero
/// @realtime alloc-free
[[nodiscard]] MotorForce motor_force(const driver::Vector3& force_newton,
                                     const driver::Vector3& position_m, double force_newton_max,
                                     double counts_per_newton_metre) noexcept;

/// The force that results from the counts, according to the model of the device.
[[nodiscard]] driver::Vector3 force_of(const LegCounts& counts, const driver::Vector3& position_m,
                                       double counts_per_newton_metre) noexcept;

}  // namespace rtpm::device_falcon
