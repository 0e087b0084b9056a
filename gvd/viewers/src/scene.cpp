#include <SceneUpdate_generated.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>

#include "builder.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::viewers {
namespace {

using driver::Vector3;

/// Proportions and thicknesses of shapes, chosen for workspaces of 0.1 to 1 m.
constexpr double kHeadShare = 0.25;
constexpr double kShaftDiameterM = 0.004;
constexpr double kHeadDiameterM = 0.009;
constexpr double kPlateM = 0.001;
constexpr double kPointM = 0.004;
constexpr double kLineM = 0.001;
/// Detents are endless: so many are drawn to each side.
constexpr int kDetentCount = 5;

struct Rgba {
  double r, g, b, a;
};
constexpr Rgba kForceColour{0.9, 0.2, 0.1, 1};
constexpr Rgba kSurfaceColour{0.2, 0.5, 0.9, 0.3};
constexpr Rgba kFieldColour{0.3, 0.8, 0.4, 0.2};
constexpr Rgba kMarkColour{0.3, 0.8, 0.4, 0.9};

double length_of(const Vector3& vector) noexcept {
  return std::hypot(vector.x, vector.y, vector.z);
}
double product(const Vector3& a, const Vector3& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
Vector3 sum(const Vector3& a, const Vector3& b, double share = 1) noexcept {
  return {a.x + share * b.x, a.y + share * b.y, a.z + share * b.z};
}

/// The shortest rotation from +x to `direction`, of length 1.
driver::Quaternion turned_to(const Vector3& direction) noexcept {
  const double w = 1 + direction.x;
  if (w < 1e-9) return {0, 0, 1, 0};
  const double size = std::hypot(direction.y, direction.z, w);
  return {0, -direction.z / size, direction.y / size, w / size};
}

class SceneBuilder {
 public:
  SceneBuilder(const Stamp& stamp, const Scene& scene)
      : scene_(scene),
        time_(time_of(stamp.time_ns)),
        lifetime_(static_cast<std::int32_t>(scene.lifetime_ns / kNsPerSecond),
                  static_cast<std::int32_t>(scene.lifetime_ns % kNsPerSecond)),
        frame_(stamp.frame) {}

  Message build() {
    add_arrow(scene_.position_m, scene_.force_newton, kForceColour);
    entities_.push_back(entity("/force"));
    for (const gvd::Model& model : scene_.models)
      std::visit([this](const auto& one) { add(one); }, model);
    entities_.push_back(entity("/models"));
    const auto entities = builder_.CreateVector(entities_);
    return finished(builder_, foxglove::CreateSceneUpdate(builder_, 0, entities));
  }

 private:
  Made<foxglove::Color> colour(const Rgba& rgba) {
    return foxglove::CreateColor(builder_, rgba.r, rgba.g, rgba.b, rgba.a);
  }

  void add_arrow(const Vector3& tail, const Vector3& force_newton, const Rgba& rgba) {
    const double force = length_of(force_newton);
    if (!(force > 0) || !std::isfinite(force)) return;
    const Vector3 direction = sum({}, force_newton, 1 / force);
    const double length = force * kArrowMetrePerNewton;
    const auto pose = pose_in(builder_, {tail, turned_to(direction)});
    arrows_.push_back(foxglove::CreateArrowPrimitive(builder_, pose, (1 - kHeadShare) * length,
                                                     kShaftDiameterM, kHeadShare * length,
                                                     kHeadDiameterM, colour(rgba)));
  }
  void add_cube(const driver::Pose& pose, const Vector3& size, const Rgba& rgba) {
    const auto place = pose_in(builder_, pose);
    const auto extent = vector_in(builder_, size);
    cubes_.push_back(foxglove::CreateCubePrimitive(builder_, place, extent, colour(rgba)));
  }
  void add_ball(const Vector3& centre, double radius_m, const Rgba& rgba) {
    const auto place = pose_in(builder_, {centre, {}});
    const double size = 2 * radius_m;
    const auto extent = vector_in(builder_, {size, size, size});
    balls_.push_back(foxglove::CreateSpherePrimitive(builder_, place, extent, colour(rgba)));
  }
  void add_line(const Vector3& from, const Vector3& to) {
    const std::vector points{foxglove::CreatePoint3(builder_, from.x, from.y, from.z),
                             foxglove::CreatePoint3(builder_, to.x, to.y, to.z)};
    const auto pose = pose_in(builder_, {});
    const auto list = builder_.CreateVector(points);
    lines_.push_back(foxglove::CreateLinePrimitive(builder_, foxglove::LineType::LINE_STRIP, pose,
                                                   kLineM, false, list, colour(kMarkColour)));
  }

  /// A plate as large as the workspace, whose face is the plane, nearest to the workspace's middle.
  void add(const gvd::Plane& plane) {
    const Vector3 middle = sum(sum({}, scene_.low_m, 0.5), scene_.high_m, 0.5);
    const double distance = product(sum(middle, plane.point_m, -1), plane.normal);
    const double width = length_of(sum(scene_.high_m, scene_.low_m, -1));
    add_cube({sum(middle, plane.normal, -distance - kPlateM / 2), turned_to(plane.normal)},
             {kPlateM, width, width}, kSurfaceColour);
  }
  void add(const gvd::Sphere& sphere) {
    add_ball(sphere.centre_m, sphere.radius_m, kSurfaceColour);
  }
  void add(const gvd::Box& box) {
    const Vector3 middle = sum(sum({}, box.low_m, 0.5), box.high_m, 0.5);
    add_cube({middle, {}}, sum(box.high_m, box.low_m, -1), kSurfaceColour);
  }
  void add(const gvd::Spring& spring) {
    add_ball(spring.anchor_m, kPointM, kMarkColour);
    add_line(spring.anchor_m, scene_.position_m);
  }
  void add(const gvd::AffineField& field) {
    add_ball(field.origin_m, field.radius_m + field.fade_m, kFieldColour);
    add_arrow(field.origin_m, field.force_newton, kMarkColour);
  }
  void add(const gvd::Detents& detents) {
    for (int i = -kDetentCount; i <= kDetentCount; ++i)
      add_ball(sum(detents.origin_m, detents.direction, i * detents.spacing_m), kPointM / 2,
               kMarkColour);
  }
  void add(const gvd::Friction& /*friction*/) {}
  void add(const gvd::DialDetents& /*detents*/) {}

  template <class T>
  auto taken(std::vector<Made<T>>& primitives) {
    const auto list = builder_.CreateVector(primitives);
    primitives.clear();
    return list;
  }

  /// An entity of the primitives so far.
  Made<foxglove::SceneEntity> entity(const char* leaf) {
    const auto frame = text_in(builder_, frame_);
    const auto id = text_in(builder_, std::string(scene_.device) + leaf);
    const auto arrows = taken(arrows_);
    const auto cubes = taken(cubes_);
    const auto balls = taken(balls_);
    const auto lines = taken(lines_);
    return foxglove::CreateSceneEntity(builder_, &time_, frame, id, &lifetime_,
                                       /*frame_locked=*/false, 0, arrows, cubes, balls, 0, lines);
  }
  const Scene& scene_;
  foxglove::Time time_;
  foxglove::Duration lifetime_;
  std::string_view frame_;
  Builder builder_{};
  std::vector<Made<foxglove::SceneEntity>> entities_{};
  std::vector<Made<foxglove::ArrowPrimitive>> arrows_{};
  std::vector<Made<foxglove::CubePrimitive>> cubes_{};
  std::vector<Made<foxglove::SpherePrimitive>> balls_{};
  std::vector<Made<foxglove::LinePrimitive>> lines_{};
};

}  // namespace

Message scene_message(const Stamp& stamp, const Scene& scene) {
  return SceneBuilder(stamp, scene).build();
}

}  // namespace rtpm::viewers
