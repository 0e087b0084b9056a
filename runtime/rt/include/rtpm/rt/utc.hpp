#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// Converts a time of this host's monotonic clock to nanoseconds since 1970 in UTC, by the current
/// wall clock: for people and files. Jumps when the wall clock is set.
/// @realtime alloc-free, no syscall if the vDSO has the clocks
[[nodiscard]] std::uint64_t utc_ns(MonotonicTime time) noexcept;

}  // namespace rtpm::rt
