#pragma once

#include <cmath>

#include "rtpm/driver/geometry.hpp"

/// Arithmetic of vectors.
/// @realtime alloc-free
namespace rtpm::gvd::vector {

[[nodiscard]] inline driver::Vector3 sum(const driver::Vector3& a,
                                         const driver::Vector3& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
[[nodiscard]] inline driver::Vector3 difference(const driver::Vector3& a,
                                                const driver::Vector3& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
[[nodiscard]] inline driver::Vector3 scaled(const driver::Vector3& a, double by) noexcept {
  return {a.x * by, a.y * by, a.z * by};
}
[[nodiscard]] inline double dot(const driver::Vector3& a, const driver::Vector3& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[nodiscard]] inline double length(const driver::Vector3& a) noexcept {
  return std::hypot(a.x, a.y, a.z);
}
/// `a`, shortened to `length_max` in the same direction.
[[nodiscard]] inline driver::Vector3 shortened(const driver::Vector3& a,
                                               double length_max) noexcept {
  const double length_now = length(a);
  return length_now > length_max ? scaled(a, length_max / length_now) : a;
}

}  // namespace rtpm::gvd::vector
