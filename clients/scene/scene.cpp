#include "scene.hpp"

#include <cmath>

#include "rtpm/driver/vector.hpp"

namespace rtpm::scene {
namespace {

constexpr double kRidgeHalfMetre = Scene::kRidgeMetre / 2;
/// The centre has no direction, and points next to it have none that a double can represent.
constexpr double kDirectionMinMetre = 1e-12;
constexpr double kSlopeMax = kRidgeHalfMetre * Scene::kRidgeRadPerMetre;

}  // namespace

std::string_view to_string(Shape shape) noexcept {
  switch (shape) {
    case Shape::kPlane:
      return "plane";
    case Shape::kSphere:
      return "sphere";
    case Shape::kTexture:
      return "texture";
  }
  return "unknown";
}

double Scene::height_m(double x_m) const noexcept {
  if (shape != Shape::kTexture) return face_m;
  return face_m - kRidgeHalfMetre * (1 - std::cos(kRidgeRadPerMetre * x_m));
}

double Scene::clearance_m(const driver::Vector3& point_m) const noexcept {
  if (shape == Shape::kSphere) return length(difference(point_m, centre_m())) - kRadiusMetre;
  const double above_m = point_m.z - height_m(point_m.x);
  // The surface of a slope is closer than its vertical distance.
  return shape == Shape::kTexture ? above_m / std::hypot(1, kSlopeMax) : above_m;
}

driver::Vector3 Scene::normal(const driver::Vector3& point_m) const noexcept {
  driver::Vector3 out{0, 0, 1};
  if (shape == Shape::kTexture) out.x = kSlopeMax * std::sin(kRidgeRadPerMetre * point_m.x);
  if (shape == Shape::kSphere) out = difference(point_m, centre_m());
  const double size = length(out);
  return size > kDirectionMinMetre ? scaled(out, 1 / size) : driver::Vector3{0, 0, 1};
}

}  // namespace rtpm::scene
