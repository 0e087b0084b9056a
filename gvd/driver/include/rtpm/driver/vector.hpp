#pragma once

#include <cmath>

#include "rtpm/driver/geometry.hpp"

/// Arithmetic of vectors.
/// @realtime alloc-free
namespace rtpm::driver {

[[nodiscard]] inline Vector3 sum(const Vector3& a, const Vector3& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
[[nodiscard]] inline Vector3 difference(const Vector3& a, const Vector3& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
[[nodiscard]] inline Vector3 scaled(const Vector3& a, double by) noexcept {
  return {a.x * by, a.y * by, a.z * by};
}
[[nodiscard]] inline double dot(const Vector3& a, const Vector3& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[nodiscard]] inline double length(const Vector3& a) noexcept {
  return std::hypot(a.x, a.y, a.z);
}
/// `a`, shortened to `length_max` in the same direction.
[[nodiscard]] inline Vector3 shortened(const Vector3& a, double length_max) noexcept {
  const double length_now = length(a);
  return length_now > length_max ? scaled(a, length_max / length_now) : a;
}
/// Whether no component is a NaN or an infinity.
[[nodiscard]] inline bool is_finite(const Vector3& a) noexcept {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

}  // namespace rtpm::driver
