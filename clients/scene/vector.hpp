#pragma once

#include <cmath>

#include "rtpm/driver/geometry.hpp"

/// Arithmetic of vectors.
/// @realtime alloc-free
namespace rtpm::scene {

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
[[nodiscard]] inline bool is_finite(const driver::Vector3& a) noexcept {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

}  // namespace rtpm::scene
