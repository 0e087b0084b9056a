#pragma once

#include <type_traits>

/// The quantities that a device measures and applies: SI units, in the device's own frame, which is
/// right-handed and named in the descriptor (Descriptor::frame). Unless a descriptor says
/// otherwise: x to the operator's right, y up, z towards the operator, origin in the middle of the
/// workspace.
namespace rtpm::driver {

struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;
  friend constexpr bool operator==(const Vector3&, const Vector3&) noexcept = default;
};

/// A rotation as a unit quaternion; the default is no rotation.
struct Quaternion {
  double x = 0;
  double y = 0;
  double z = 0;
  double w = 1;
  friend constexpr bool operator==(const Quaternion&, const Quaternion&) noexcept = default;
};

/// Position and orientation of the end effector.
struct Pose {
  Vector3 position_m{};
  Quaternion orientation{};
};

/// Velocity of the end effector.
struct Twist {
  Vector3 linear_m_per_s{};
  Vector3 angular_rad_per_s{};
};

/// Force and torque on the end effector.
struct Wrench {
  Vector3 force_newton{};
  Vector3 torque_newton_metre{};
  friend constexpr bool operator==(const Wrench&, const Wrench&) noexcept = default;
};

static_assert(std::is_trivially_copyable_v<Pose> && std::is_trivially_copyable_v<Twist> &&
              std::is_trivially_copyable_v<Wrench>);

}  // namespace rtpm::driver
