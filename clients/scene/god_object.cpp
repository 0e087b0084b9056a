#include "god_object.hpp"

#include <algorithm>
#include <cmath>

#include "rtpm/driver/vector.hpp"

namespace rtpm::scene {
namespace {

using driver::Vector3;

constexpr int kTravelStepMax = 64;
constexpr int kSlideStepMax = 32;
/// The longest slide per call: 5 m/s at 1 kHz, faster than a hand moves along a surface.
constexpr double kSlideMaxMetre = 0.005;
/// Short compared with the texture's ridges, so that the proxy follows them.
constexpr double kStrideMaxMetre = 0.001;
/// A shorter slide counts as standing still.
constexpr double kStrideMinMetre = 1e-8;
/// How far a slide lifts off, relative to its length: more than a hollow rises within one stride,
/// but far less than a hollow's smallest radius, so that the lift itself hits nothing.
constexpr double kLiftShare = 0.25;

}  // namespace

bool is_position(const Vector3& point_m) noexcept {
  const auto is_near = [](double coordinate) { return std::abs(coordinate) <= kExtentMetre; };
  return is_near(point_m.x) && is_near(point_m.y) && is_near(point_m.z);
}

Touch GodObject::touch(const driver::Sample& sample) noexcept {
  const Vector3& device_m = sample.pose.position_m;
  if (!is_position(device_m)) {
    const Vector3 stays = proxy_m_.value_or(lifted_out({0, 0, scene_.face_m}));
    return {.device_m = stays, .proxy_m = stays};
  }
  if (!proxy_m_) proxy_m_ = lifted_out(device_m);
  proxy_m_ = slide(travel(*proxy_m_, device_m), device_m);
  Touch touch{.device_m = device_m, .proxy_m = *proxy_m_};
  touch.depth_m = length(difference(touch.proxy_m, device_m));
  touch.force_newton = force_newton(touch, sample.twist.linear_m_per_s);
  return touch;
}

Vector3 GodObject::force_newton(const Touch& touch, const Vector3& velocity) const noexcept {
  if (touch.depth_m <= 0) return {};
  const Vector3 out = scaled(difference(touch.proxy_m, touch.device_m), 1 / touch.depth_m);
  const double speed_m_per_s = is_finite(velocity) ? dot(velocity, out) : 0;
  return scaled(out, std::max(0.0, material_.stiffness_newton_per_m * touch.depth_m -
                                       material_.damping_newton_s_per_m * speed_m_per_s));
}

/// Returns a point outside the solid: `point_m`, or the one above it on the surface.
Vector3 GodObject::lifted_out(Vector3 point_m) const noexcept {
  for (int i = 0; i < kTravelStepMax; ++i) {
    const double missing_m = 2 * kSkinMetre - scene_.clearance_m(point_m);
    if (missing_m <= kSkinMetre) return point_m;
    point_m = sum(point_m, scaled(scene_.normal(point_m), missing_m));
  }
  return {point_m.x, point_m.y, scene_.face_m + 2 * kSkinMetre};
}

/// Returns the last point outside the solid on the straight line from `from_m` to `to_m`.
Vector3 GodObject::travel(Vector3 from_m, const Vector3& to_m) const noexcept {
  for (int i = 0; i < kTravelStepMax; ++i) {
    const Vector3 rest = difference(to_m, from_m);
    const double rest_m = length(rest);
    // The surface is at least the clearance away, so the path is free for that distance.
    const double free_m = scene_.clearance_m(from_m) - kSkinMetre;
    if (free_m >= rest_m) return to_m;
    if (free_m <= kSkinMetre / 10) return from_m;
    from_m = sum(from_m, scaled(rest, free_m / rest_m));
  }
  return from_m;
}

/// Slides along the surface from a point on it, so that the distance to the goal decreases.
Vector3 GodObject::slide(Vector3 from_m, const Vector3& goal_m) const noexcept {
  double stride_max_m = kStrideMaxMetre;
  double left_m = kSlideMaxMetre;
  for (int i = 0; i < kSlideStepMax && left_m > 0 && from_m != goal_m; ++i) {
    const Vector3 normal = scene_.normal(from_m);
    const Vector3 rest = difference(goal_m, from_m);
    const double out_m = dot(rest, normal);
    const Vector3 along = difference(rest, scaled(normal, out_m));
    const double along_m = length(along);
    const double stride_m = std::min(along_m, stride_max_m);
    if (stride_m < kStrideMinMetre && out_m <= 0) break;
    const double lift_m = std::max(kLiftShare * stride_m, kSkinMetre);
    const Vector3 lifted = sum(from_m, scaled(normal, lift_m));
    if (scene_.clearance_m(lifted) < kSkinMetre) break;
    const Vector3 ahead = along_m > 0 ? sum(lifted, scaled(along, stride_m / along_m)) : lifted;
    const Vector3 next = travel(travel(lifted, ahead), goal_m);
    if (length(difference(goal_m, next)) < length(rest)) {
      from_m = next;
      left_m -= stride_m;
    } else {
      stride_max_m = stride_m / 2;
    }
  }
  return from_m;
}

}  // namespace rtpm::scene
