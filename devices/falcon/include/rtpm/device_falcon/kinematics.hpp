#pragma once

#include <array>
#include <numbers>
#include <optional>

#include "rtpm/device_falcon/protocol.hpp"
#include "rtpm/driver/geometry.hpp"

/// The Falcon's parallel mechanism: three legs between the base and the grip. Positions are in the
/// mechanism's own frame: x to the operator's right, y up, z out of the device towards the
/// operator, origin in the base.
/// @source   geometry: libnifalcon's FalconGeometry.h; the Jacobian is derived from the closure of
///           each leg's loop, since libnifalcon's column for z is wrong
namespace rtpm::device_falcon {

using Matrix3 = std::array<std::array<double, 3>, 3>;  ///< Rows.

/// The angles of the legs, in radian.
struct LegAngles {
  std::array<double, 3> upper{};     ///< Angles of the driven arms, as the encoders measure them.
  std::array<double, 3> lower{};     ///< Angles of the parallelograms in their leg's plane.
  std::array<double, 3> sideways{};  ///< Angles of the parallelograms out of their leg's plane.
};

/// Angle of the driven arm per encoder count: 1280 counts per turn of a drum of 14.25 mm, which
/// drives one of 110 mm.
inline constexpr double kRadianPerCount = 14.25 / 110 * 2 * std::numbers::pi / 1280;
/// The grip's position at which all encoders read zero.
inline constexpr double kZeroCountsZMetres = 0.13460243;
/// The middle of the workspace.
inline constexpr driver::Vector3 kCentreMetres{0, 0, 0.125};
/// The step of the position per encoder count, along z.
inline constexpr double kResolutionMetres = 4.6e-5;

[[nodiscard]] std::array<double, 3> upper_angles(const LegCounts& counts) noexcept;
/// The inverse of upper_angles(), not rounded.
[[nodiscard]] std::array<double, 3> encoder_counts(const std::array<double, 3>& upper) noexcept;

/// The angles at a position; nullopt if no leg reaches it, or it is not finite.
/// @realtime alloc-free
[[nodiscard]] std::optional<LegAngles> inverse(const driver::Vector3& position_m) noexcept;

/// Rates of the upper angles per velocity, in rad/m.
/// @realtime alloc-free
[[nodiscard]] Matrix3 jacobian(const LegAngles& angles) noexcept;

/// The position of given upper angles, by Newton's method from `start_m`, to 1e-9 rad.
/// @return nullopt if it did not converge in 10 steps, so that no such position is near
/// @realtime alloc-free, at most 10 steps
[[nodiscard]] std::optional<driver::Vector3> forward(const std::array<double, 3>& upper,
                                                     const driver::Vector3& start_m) noexcept;

/// The motors' commands, and the force that they then apply.
struct MotorForce {
  LegCounts counts{};
  driver::Vector3 applied_newton{};
  bool is_saturated = false;  ///< Less than the request.
};

/// The motors' counts for a force at a position. A force above `force_newton_max`, or beyond a
/// motor's range, is shortened and keeps its direction. The result is zero if the mechanism
/// can't reach the position, or the force is not finite.
/// @param counts_per_newton_metre  above zero
/// @realtime alloc-free
[[nodiscard]] MotorForce motor_force(const driver::Vector3& force_newton,
                                     const driver::Vector3& position_m, double force_newton_max,
                                     double counts_per_newton_metre) noexcept;

/// The force that counts make, as the model of the device computes it.
[[nodiscard]] driver::Vector3 force_of(const LegCounts& counts, const driver::Vector3& position_m,
                                       double counts_per_newton_metre) noexcept;

}  // namespace rtpm::device_falcon
