#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

/// The system's clocks.
namespace rtpm::rt::os {

/// The system's monotonic clock.
/// @realtime alloc-free
[[nodiscard]] std::int64_t time_ns() noexcept;

/// Sleeps until `time`, even if signals arrive; never ends early.
/// @realtime alloc-free
void sleep_until(MonotonicTime time) noexcept;

/// The CPU time of the calling thread.
/// @realtime alloc-free, one system call
[[nodiscard]] Duration thread_run_time() noexcept;

}  // namespace rtpm::rt::os
