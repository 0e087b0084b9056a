#pragma once

#include <windows.h>

#include "rtpm/base/time.hpp"

namespace rtpm::rt::os {

/// The calling thread's waitable timer, armed to fire at `time` or slightly later: a wait for it
/// may still end early. The thread owns it.
/// @realtime alloc-free, one system call; a thread's first call makes the timer
[[nodiscard]] HANDLE timer_at(MonotonicTime time) noexcept;

/// Whether the system's timers are of high resolution.
/// @realtime set-up only
[[nodiscard]] bool has_fine_timers() noexcept;

}  // namespace rtpm::rt::os
