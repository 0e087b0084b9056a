#pragma once

#include "rtpm/rt/priority.hpp"

namespace rtpm::rt {

/// Puts the calling thread at the SCHED_FIFO level; false if the system refuses.
bool set_native_level(int level) noexcept;

/// The SCHED_FIFO level that the calling thread is known to have; 0: time-shared, or not known.
[[nodiscard]] int native_level() noexcept;

/// Says at which priority the calling thread was started, and whether the system granted it.
void note_thread_priority(Priority priority, bool is_fifo) noexcept;

}  // namespace rtpm::rt
