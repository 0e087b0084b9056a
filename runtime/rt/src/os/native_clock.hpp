#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

/// The system's clocks.
namespace rtpm::rt::os {

/// The system's monotonic clock.
/// @realtime alloc-free
[[nodiscard]] std::int64_t time_ns() noexcept;

/// Whether the processor's tick counter is the system's own clock: its rate is constant, it never
/// stops, and it is the same on all CPUs.
/// @realtime the first call may read a file
[[nodiscard]] bool counts_ticks() noexcept;

/// Sleeps until `time`, even if signals arrive; never ends early.
/// @realtime alloc-free
void sleep_until(MonotonicTime time) noexcept;

/// The CPU time of the calling thread.
/// @realtime alloc-free, one system call
[[nodiscard]] Duration thread_run_time() noexcept;

}  // namespace rtpm::rt::os
