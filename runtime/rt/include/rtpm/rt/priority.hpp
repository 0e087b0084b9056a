#pragma once

#include <optional>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// The SCHED_FIFO levels that RTPM uses, of which Windows makes six. The top ones are left to the
/// kernel's own threads: migration and watchdog run at 99, and RTPM must never delay them.
inline constexpr int kNativeLowest = 1;
inline constexpr int kNativeHighest = 89;

/// The SCHED_FIFO level of a priority: linear, 0 → 1 … 32767 → 89, rounded down.
/// @realtime alloc-free
/// @source   RT-CORBA's linear mapping, level = min + (max − min) · p / 32767
[[nodiscard]] constexpr int to_native(Priority priority) noexcept {
  return kNativeLowest + (kNativeHighest - kNativeLowest) * priority.value() / Priority::kHighest;
}

/// Maps a priority to a SCHED_FIFO level. Must not allocate, lock or throw.
using PriorityMapping = int (*)(Priority priority);

/// Makes all threads of the program use another mapping than to_native(); null restores
/// to_native(). Levels 1 to 98 are allowed, and a higher priority must not get a lower level.
/// Set-up only: call it before the first thread with a priority starts.
/// @threads  one
/// @errors   a level that is not allowed, with the priority that gets it; the mapping does not
///           change
/// @source   RT-CORBA's PriorityMapping, which may be replaced
[[nodiscard]] expected<void, SetupError> set_priority_mapping(PriorityMapping mapping);

/// The level of a priority under the current mapping.
/// @realtime alloc-free if the mapping is
[[nodiscard]] int level_of(Priority priority) noexcept;

/// The calling thread's priority, which its calls carry; nullopt until it is set.
/// @realtime alloc-free
[[nodiscard]] std::optional<Priority> current_priority() noexcept;

/// Sets the calling thread's priority for its calls and, if the system allows, its SCHED_FIFO
/// level. False if it does not; calls carry the priority anyway.
/// @realtime alloc-free, at most one syscall, none if the level is already right. A level set by
///           other means than RTPM's is not noticed
/// @source   RT-CORBA's RTCurrent::the_priority
bool set_current_priority(Priority priority) noexcept;

/// Changes the calling thread's priority like set_current_priority(), but leaves a time-shared
/// thread time-shared: its owner asked for that, or the system refused a real-time level.
/// @realtime alloc-free; one syscall if the native level changes, otherwise none
void adopt_priority(Priority priority) noexcept;

}  // namespace rtpm::rt

namespace rtpm {
using rt::current_priority;
using rt::set_current_priority;
}  // namespace rtpm
