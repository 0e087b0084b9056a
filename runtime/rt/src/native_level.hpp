#pragma once

#include "rtpm/rt/priority.hpp"

namespace rtpm::rt {

/// Sets the calling thread's SCHED_FIFO level; false if the system refuses.
bool set_native_level(int level) noexcept;

/// The calling thread's known SCHED_FIFO level; 0 if time-shared or unknown.
[[nodiscard]] int native_level() noexcept;

/// Records the calling thread's initial priority, and whether it was granted.
void note_thread_priority(Priority priority, bool is_fifo) noexcept;

}  // namespace rtpm::rt
