#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// The time on CLOCK_MONOTONIC.   RT: alloc-free, no syscall where the vDSO has the clock.
[[nodiscard]] MonotonicTime now() noexcept;

/// Sleeps until `time`, through signals.   RT: alloc-free, one syscall.
void sleep_until(MonotonicTime time) noexcept;

}  // namespace rtpm::rt
