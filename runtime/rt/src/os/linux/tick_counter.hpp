#pragma once

#include <cstdint>

/// The processor's tick counter.
namespace rtpm::rt::os {

#if defined(__x86_64__)
inline constexpr bool kMayCountTicks = true;
/// @realtime alloc-free, no system call
[[nodiscard]] inline std::uint64_t ticks() noexcept {
  return __builtin_ia32_rdtsc();
}
#else
inline constexpr bool kMayCountTicks = false;
[[nodiscard]] inline std::uint64_t ticks() noexcept {
  return 0;
}
#endif

/// Whether the counter is the system's own clock: its rate is constant, it never stops, and it is
/// the same on all CPUs.
/// @realtime the first call reads a file
[[nodiscard]] bool counts_ticks() noexcept;

}  // namespace rtpm::rt::os
