#pragma once

#include <cmath>

#include "rtpm/driver/geometry.hpp"

namespace rtpm::gvd {

/// Whether no component is a NaN or an infinity.
/// @realtime alloc-free
[[nodiscard]] inline bool is_finite(const driver::Vector3& vector) noexcept {
  return std::isfinite(vector.x) && std::isfinite(vector.y) && std::isfinite(vector.z);
}
[[nodiscard]] inline bool is_finite(const driver::Wrench& wrench) noexcept {
  return is_finite(wrench.force_newton) && is_finite(wrench.torque_newton_metre);
}

}  // namespace rtpm::gvd
