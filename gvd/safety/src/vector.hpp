#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/vector.hpp"

namespace rtpm::gvd {

inline driver::Wrench scaled(const driver::Wrench& wrench, double by) noexcept {
  return {scaled(wrench.force_newton, by), scaled(wrench.torque_newton_metre, by)};
}
inline double seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

/// Shortens `vector` to `length_max`, keeping its direction; true if it was longer. Never squares a
/// component, which could overflow.
inline bool shorten(driver::Vector3& vector, double length_max) noexcept {
  const double greatest = std::max({std::abs(vector.x), std::abs(vector.y), std::abs(vector.z)});
  if (greatest <= 0) return false;
  const driver::Vector3 direction{vector.x / greatest, vector.y / greatest, vector.z / greatest};
  const double share = length_max / length(direction);
  if (greatest <= share) return false;
  vector = scaled(direction, share);
  return true;
}

}  // namespace rtpm::gvd
