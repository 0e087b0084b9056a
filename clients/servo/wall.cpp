#include "wall.hpp"

#include <algorithm>

namespace rtpm::servo {

scene::GodObject Wall::proxy() const noexcept {
  return {{shape, face_m}, material()};
}

gvd::Plane Wall::as_plane() const noexcept {
  return {.point_m = {0, 0, face_m},
          .normal = {0, 0, 1},
          .stiffness_newton_per_m = stiffness_newton_per_m,
          .damping_newton_s_per_m = damping_newton_s_per_m};
}

double stiffness_bound(double device_damping_newton_s_per_m, double wall_damping_newton_s_per_m,
                       Duration loop_period, Duration device_period) noexcept {
  const double delay_s = std::chrono::duration<double>(loop_period).count() / 2 +
                         2 * std::chrono::duration<double>(device_period).count();
  return std::max(0.0, device_damping_newton_s_per_m - wall_damping_newton_s_per_m) / delay_s;
}

}  // namespace rtpm::servo
