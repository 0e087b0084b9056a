#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// The time on CLOCK_MONOTONIC (Windows: of its performance counter), to within 0.1 µs. If the
/// kernel's clock is the processor's tick counter, ticks are counted between two reads of it, at
/// most a millisecond apart. Never goes back on one thread; times on different threads are only
/// ordered if they differ by more than the error.
/// @realtime alloc-free, no syscall if the vDSO has the clock; the first call in a process reads a
///           file
[[nodiscard]] MonotonicTime now() noexcept;

/// Sleeps until `time`, even if signals arrive.
/// @realtime alloc-free, one syscall
void sleep_until(MonotonicTime time) noexcept;

}  // namespace rtpm::rt
