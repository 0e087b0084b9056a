#pragma once

#include <cstdint>
#include <numbers>
#include <string_view>

#include "rtpm/driver/geometry.hpp"

/// The shapes that the haptic servo renders.
namespace rtpm::scene {

enum class Shape : std::uint8_t {
  kPlane = 0,    ///< Everything below the face.
  kSphere = 1,   ///< A ball below the face, which touches it at x = y = 0.
  kTexture = 2,  ///< A height field below the face: ridges along y, whose crests touch the face.
};
inline constexpr std::uint8_t kShapeCount = 3;

/// "plane", "sphere", "texture".
[[nodiscard]] std::string_view to_string(Shape shape) noexcept;

/// A solid in the device's frame. Its highest point is at z = face_m, and +z points out of it.
/// @ownership a value
/// @realtime alloc-free
struct Scene {
  static constexpr double kRadiusMetre = 0.03;         ///< The sphere's radius.
  static constexpr double kRidgeMetre = 0.003;         ///< Height from trough to crest.
  static constexpr double kRidgeSpacingMetre = 0.015;  ///< Distance from crest to crest.
  /// The texture's phase along x.
  static constexpr double kRidgeRadPerMetre = 2 * std::numbers::pi / kRidgeSpacingMetre;

  Shape shape = Shape::kPlane;
  double face_m = 0;

  /// A lower bound of the distance to the surface, negative inside; 0 exactly on the surface.
  /// Between two points it changes by at most their distance.
  [[nodiscard]] double clearance_m(const driver::Vector3& point_m) const noexcept;
  /// The unit direction in which the clearance grows fastest; +z at the sphere's centre.
  [[nodiscard]] driver::Vector3 normal(const driver::Vector3& point_m) const noexcept;
  /// The z coordinate of the surface of a plane or texture.
  [[nodiscard]] double height_m(double x_m) const noexcept;
  /// The sphere's centre.
  [[nodiscard]] driver::Vector3 centre_m() const noexcept { return {0, 0, face_m - kRadiusMetre}; }

  friend constexpr bool operator==(const Scene&, const Scene&) noexcept = default;
};

}  // namespace rtpm::scene
