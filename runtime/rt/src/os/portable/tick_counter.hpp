#pragma once

#include <cstdint>

// These systems do not tell whether the processor's tick counter is their clock.
namespace rtpm::rt::os {

inline constexpr bool kMayCountTicks = false;
[[nodiscard]] inline std::uint64_t ticks() noexcept {
  return 0;
}
[[nodiscard]] constexpr bool counts_ticks() noexcept {
  return false;
}

}  // namespace rtpm::rt::os
