#pragma once

#include <optional>

#include "rtpm/driver/sample.hpp"
#include "scene.hpp"

namespace rtpm::scene {

/// A limit for coordinates, far beyond any workspace.
inline constexpr double kExtentMetre = 100;
/// Whether a point is finite and within kExtentMetre. Alloc-free.
[[nodiscard]] bool is_position(const driver::Vector3& point_m) noexcept;

/// The properties of the solid that the device feels.
struct Material {
  double stiffness_newton_per_m = 0;
  double damping_newton_s_per_m = 0;
};

/// A device in contact with a scene, or near it.
struct Touch {
  driver::Vector3 device_m{};
  driver::Vector3 proxy_m{};  ///< Outside the solid; in free space, the device's position.
  driver::Vector3 force_newton{};
  double depth_m = 0;  ///< The distance from device to proxy; 0 in free space.
};

/// A proxy that follows a device but never enters the solid, and a spring between the two. The
/// proxy moves straight towards the device; at the surface it slides, without friction, to the
/// point nearest to the device. So it remembers where the device entered: a device that jumps
/// through a thin part is pushed back, not out on the other side. Has no clock.
///
/// force = stiffness · (proxy − device) − damping · (velocity along that direction); it never
/// pulls.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free; a bounded number of steps: a proxy that needs more arrives in later calls
/// @source   Zilles and Salisbury, "A constraint-based god-object method for haptic display" (1995)
class GodObject {
 public:
  /// The distance from the surface at which the proxy rests.
  static constexpr double kSkinMetre = 1e-7;

  GodObject(const Scene& scene, const Material& material) noexcept
      : scene_(scene), material_(material) {}

  /// Follows the device. The first call puts the proxy at the device, or on the surface above it.
  /// If the device's position is not valid by is_position(), the proxy stays, and there is no
  /// force.
  [[nodiscard]] Touch touch(const driver::Sample& sample) noexcept;
  [[nodiscard]] const Scene& scene() const noexcept { return scene_; }
  /// Takes effect from the next touch.
  void set_material(const Material& material) noexcept { material_ = material; }

 private:
  [[nodiscard]] driver::Vector3 lifted_out(driver::Vector3 point_m) const noexcept;
  [[nodiscard]] driver::Vector3 travel(driver::Vector3 from_m,
                                       const driver::Vector3& to_m) const noexcept;
  [[nodiscard]] driver::Vector3 slide(driver::Vector3 from_m,
                                      const driver::Vector3& goal_m) const noexcept;
  [[nodiscard]] driver::Vector3 force_newton(const Touch& touch,
                                             const driver::Vector3& velocity) const noexcept;

  Scene scene_;
  Material material_;
  std::optional<driver::Vector3> proxy_m_{};
};

}  // namespace rtpm::scene
