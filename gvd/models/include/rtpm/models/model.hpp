#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <variant>

#include "rtpm/base/assert.hpp"
#include "rtpm/driver/geometry.hpp"

/// Local models: force fields that a device's own loop renders, so that their feel does not depend
/// on the link. Positions and directions are in the device's frame (Descriptor::frame), SI units. x
/// is the end effector's position, v its velocity. A penetration depth is 0 outside and positive
/// inside; a normal has length 1 and points out of the material, in the direction of decreasing
/// depth. check() defines each range.
/// @ownership plain values, trivially copyable
namespace rtpm::gvd {

/// A half space of material behind a plane, a wall: depth = max(0, (point − x) · normal); force =
/// normal · max(0, stiffness · depth − damping · v · normal) inside. It never pulls. Without
/// damping the force is continuous everywhere; with damping, an end effector that enters at speed
/// immediately meets damping · speed.
struct Plane {
  driver::Vector3 point_m{};        ///< Any point of the face.
  driver::Vector3 normal{0, 0, 1};  ///< Points out of the material; length 1.
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
  friend constexpr bool operator==(const Plane&, const Plane&) noexcept = default;
};

/// The side of a surface that is material.
enum class Side : std::uint8_t {
  kSolid = 0,   ///< Inside: it keeps the end effector out.
  kHollow = 1,  ///< Outside: it keeps the end effector in.
};
inline constexpr std::uint8_t kSideCount = 2;

/// A ball or a spherical cavity; force as Plane's. Depth: the distance to the surface; normal:
/// radial. A ball has no normal, and no force, at its exact centre.
struct Sphere {
  driver::Vector3 centre_m{};
  double radius_m = 0;  ///< Above 0.
  Side side = Side::kSolid;
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
  friend constexpr bool operator==(const Sphere&, const Sphere&) noexcept = default;
};

/// A box along the frame's axes, or a room; force as Plane's. In the material around a room, depth
/// and normal lead to the nearest point of the room. In a solid box they lead to the nearest face.
/// There the force changes direction halfway between two faces, so a thin plate lets an end
/// effector through once it is pressed past the middle.
struct Box {
  driver::Vector3 low_m{};
  driver::Vector3 high_m{};  ///< Above low_m in each coordinate.
  Side side = Side::kSolid;
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
  friend constexpr bool operator==(const Box&, const Box&) noexcept = default;
};

/// A damped spring to a point: stiffness · (anchor − x), limited to force_newton_max, minus
/// damping · v.
struct Spring {
  driver::Vector3 anchor_m{};
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
  double force_newton_max = 0;  ///< Limits the spring's force, without the damper's.
  friend constexpr bool operator==(const Spring&, const Spring&) noexcept = default;
};

/// An affine force field in a ball: (force + jacobian · (x − origin)) · fade. The fade is 1 up to
/// radius_m from the origin, falls linearly to 0 over fade_m, and is 0 beyond, so that the field
/// has no edge. A field may add energy, for instance if its forces circulate around a point; the
/// safety filter limits this.
/// @source   force, jacobian and radius as vrpn_ForceDevice's force field
struct AffineField {
  driver::Vector3 origin_m{};
  driver::Vector3 force_newton{};  ///< At the origin.
  /// Row by row: element 3·i + j is the change of force component i along coordinate j.
  std::array<double, 9> jacobian_newton_per_m{};
  double radius_m = 0;
  double fade_m = 0;  ///< Above 0, and wide enough for the stiffness that the fade itself adds.
  friend constexpr bool operator==(const AffineField&, const AffineField&) noexcept = default;
};

/// Dry friction, and viscosity − viscosity · v. Dry friction is a spring from x to a contact point.
/// The point starts at the end effector, sticks while the spring's force is below force_newton, and
/// slides after the end effector otherwise. The model needs no velocity, so it neither drifts nor
/// chatters.
/// @source   Hayward and Armstrong, "A new computational model of friction applied to haptic
///           rendering" (2000), with constant stiffness
struct Friction {
  double force_newton = 0;            ///< The force while sliding; 0 for viscosity only.
  double stiffness_newton_per_m = 0;  ///< While sticking; above 0 with force_newton.
  double viscosity_newton_s_per_m = 0;
  friend constexpr bool operator==(const Friction&, const Friction&) noexcept = default;
};

/// Detents along a line, unlimited to its sides: − direction · (force · sin(2π · s / spacing) +
/// damping · v · direction) at s = (x − origin) · direction. Stable at every multiple of the
/// spacing.
struct Detents {
  driver::Vector3 origin_m{};          ///< One of the detents.
  driver::Vector3 direction{1, 0, 0};  ///< Length 1.
  double spacing_m = 0;                ///< Above 0.
  double force_newton = 0;             ///< Greatest force, a quarter of a spacing from a detent.
  double damping_newton_s_per_m = 0;
  friend constexpr bool operator==(const Detents&, const Detents&) noexcept = default;
};

/// Detents of a joint that turns, as its effort: − effort · sin(2π · (a − origin) / spacing) −
/// damping · velocity, where `a` is the joint's angle, clamped to low…high. Beyond low or high an
/// end stop adds end_stiffness · (the way back).
struct DialDetents {
  std::uint8_t joint = 0;  ///< Index in Descriptor::joints, of a joint that turns and has a motor.
  double origin_rad = 0;   ///< One of the detents.
  double spacing_rad = 0;  ///< Above 0.
  double effort_newton_metre = 0;
  double damping_newton_metre_s_per_rad = 0;
  double low_rad = 0;  ///< Equal to `high_rad` without end stops.
  double high_rad = 0;
  double end_stiffness_newton_metre_per_rad = 0;
  friend constexpr bool operator==(const DialDetents&, const DialDetents&) noexcept = default;
};

using Model = std::variant<Plane, Sphere, Box, Spring, AffineField, Friction, Detents, DialDetents>;
static_assert(std::is_trivially_copyable_v<Model>);

/// "plane", "sphere", "box", "spring", "affine field", "friction", "detents", "dial detents".
[[nodiscard]] std::string_view to_string(const Model& model) noexcept;

/// The models of one client; their forces add up.
/// @ownership a value, trivially copyable, at most kCountMax models in place
/// @realtime alloc-free
class ModelList {
 public:
  static constexpr std::size_t kCountMax = 16;

  constexpr ModelList() noexcept = default;
  /// @param models  at most kCountMax
  explicit ModelList(std::span<const Model> models) noexcept : count_(models.size()) {
    RTPM_ASSERT(models.size() <= kCountMax, "a list has at most kCountMax models");
    for (std::size_t i = 0; i < count_; ++i)
      models_[i] = models[i];
  }

  [[nodiscard]] std::span<const Model> models() const noexcept { return {models_.data(), count_}; }
  [[nodiscard]] bool is_empty() const noexcept { return count_ == 0; }

 private:
  std::array<Model, kCountMax> models_{};
  std::size_t count_ = 0;
};
static_assert(std::is_trivially_copyable_v<ModelList>);

}  // namespace rtpm::gvd
