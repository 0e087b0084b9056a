#pragma once

#include <optional>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// The SCHED_FIFO levels that RTPM uses. The top ones are left to the kernel's own threads:
/// migration and watchdog run at 99, and RTPM must never delay them.
inline constexpr int kNativeLowest = 1;
inline constexpr int kNativeHighest = 89;

/// The SCHED_FIFO level of a priority: linear, 0 → 1 … 32767 → 89, rounded down.
/// @realtime alloc-free
/// @source   RT-CORBA's linear mapping, level = min + (max − min) · p / 32767
[[nodiscard]] constexpr int to_native(Priority priority) noexcept {
  return kNativeLowest + (kNativeHighest - kNativeLowest) * priority.value() / Priority::kHighest;
}

/// Turns a priority into a SCHED_FIFO level. It must not allocate, lock or throw.
using PriorityMapping = int (*)(Priority priority);

/// Makes all threads of the program use another mapping than to_native(); null restores
/// to_native(). Levels 1 to 98 are allowed, and a higher priority must not have a lower level.
/// Set-up only: before the first thread with a priority.
/// @threads  one
/// @errors   a level that is not allowed, with the priority that gets it; the mapping stays as it
///           was
/// @source   RT-CORBA's PriorityMapping, which may be replaced
[[nodiscard]] expected<void, SetupError> set_priority_mapping(PriorityMapping mapping);

/// The level of a priority by the mapping in force.
/// @realtime alloc-free, as far as the mapping is
[[nodiscard]] int level_of(Priority priority) noexcept;

/// The calling thread's priority, which its calls carry; none until it was set.
/// @realtime alloc-free
[[nodiscard]] std::optional<Priority> current_priority() noexcept;

/// Sets the calling thread's priority for its calls and, where the system allows, its SCHED_FIFO
/// level; false where it does not (the calls carry the priority all the same).
/// @realtime alloc-free, at most one syscall, none when the level is already right. A level set by
///           other means than RTPM's is not noticed
/// @source   RT-CORBA's RTCurrent::the_priority
bool set_current_priority(Priority priority) noexcept;

/// Lets the calling thread go on at another priority, as set_current_priority() does, but leaves a
/// time-shared thread time-shared: its owner asked for that, or the system refused a real-time
/// level.
/// @realtime alloc-free; no syscall where the native level stays the same, else one
void adopt_priority(Priority priority) noexcept;

}  // namespace rtpm::rt

namespace rtpm {
using rt::current_priority;
using rt::set_current_priority;
}  // namespace rtpm
