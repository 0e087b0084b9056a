#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// A time of this host's monotonic clock as nanoseconds since 1970 in UTC, by the present wall
/// clock: for people and files. It jumps when the wall clock is set.
/// @realtime alloc-free, no syscall where the vDSO has the clocks
[[nodiscard]] std::uint64_t utc_ns(MonotonicTime time) noexcept;

}  // namespace rtpm::rt
