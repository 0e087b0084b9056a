#pragma once

#include "rtpm/driver/vector.hpp"

namespace rtpm::gvd {

/// Whether no component is a NaN or an infinity.
/// @realtime alloc-free
[[nodiscard]] inline bool is_finite(const driver::Wrench& wrench) noexcept {
  return is_finite(wrench.force_newton) && is_finite(wrench.torque_newton_metre);
}

}  // namespace rtpm::gvd
