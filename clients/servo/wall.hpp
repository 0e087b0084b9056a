#pragma once

#include "god_object.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/models/model.hpp"
#include "scene.hpp"

namespace rtpm::servo {

/// The solid that the loop renders. By default a flat wall with its face towards the operator:
/// everything below z = `face_m` is wall. Inside, a spring and a damper push out; a wall never
/// pulls.
struct Wall {
  double face_m = 0;
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
  scene::Shape shape = scene::Shape::kPlane;

  [[nodiscard]] scene::Material material() const noexcept {
    return {stiffness_newton_per_m, damping_newton_s_per_m};
  }
  /// The proxy that follows the end effector and computes its force. Alloc-free.
  [[nodiscard]] scene::GodObject proxy() const noexcept;
  /// This wall as a plane for the device's own loop; only for planes. Alloc-free.
  [[nodiscard]] gvd::Plane as_plane() const noexcept;
};

/// The maximum stiffness K at which the wall stays passive (it feeds no energy back), for a loop of
/// `loop_period`, a device of `device_period` with its own damping b, and a wall of damping B:
///
///     K < (b − B) / (loop_period / 2 + 2 · device_period)
///
/// A force is held for one period of the loop, half a period on average. Before that, the sample
/// may be one device period old, and the force may wait another one for its cycle. The calls
/// themselves take some tens of µs, which is small in comparison. Above the bound the wall buzzes,
/// and the hand must damp it or the safety filter stop it. The bound is in N/m; 0 if the wall's
/// damping is at least the device's. Source: Colgate's condition for sampled walls, b > K · (T / 2
/// + delay) + B.
[[nodiscard]] double stiffness_bound(double device_damping_newton_s_per_m,
                                     double wall_damping_newton_s_per_m, Duration loop_period,
                                     Duration device_period) noexcept;

}  // namespace rtpm::servo
