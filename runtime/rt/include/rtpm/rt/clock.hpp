#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// The time on CLOCK_MONOTONIC, to within 0.1 µs: if the kernel keeps time by the processor's
/// ticks, they are counted between two reads of its clock, a millisecond apart at most. Never goes
/// back on one thread; between two threads, only times further apart than that are ordered.
/// @realtime alloc-free, no syscall where the vDSO has the clock; the first call in a process reads
///           a file
[[nodiscard]] MonotonicTime now() noexcept;

/// Sleeps until `time`, through signals.
/// @realtime alloc-free, one syscall
void sleep_until(MonotonicTime time) noexcept;

}  // namespace rtpm::rt
