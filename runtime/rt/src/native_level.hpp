#pragma once

#include "rtpm/rt/priority.hpp"

namespace rtpm::rt {

/// Puts the calling thread at the SCHED_FIFO level; false if the system refuses.
bool set_native_level(int level) noexcept;

/// The SCHED_FIFO level that the calling thread is known to have; 0 if time-shared, or not known.
[[nodiscard]] int native_level() noexcept;

/// Records the priority at which the calling thread was started, and whether it was granted.
void note_thread_priority(Priority priority, bool is_fifo) noexcept;

}  // namespace rtpm::rt
