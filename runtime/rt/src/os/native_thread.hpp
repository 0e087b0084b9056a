#pragma once

#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

/// The system's threads, and their real-time levels: rtpm/rt/priority.hpp has the range.
namespace rtpm::rt::os {

/// Names the calling thread for debuggers and lists of processes, as far as the system can.
/// @realtime set-up only
void name_this_thread(const std::string& name) noexcept;

/// Confines the calling thread to these CPUs.
/// @param subject  the thread, for the error: "thread 'lane0'"
/// @realtime set-up only
/// @errors   a CPU that does not exist; a system that can't
[[nodiscard]] expected<void, SetupError> confine_this_thread(const std::string& subject,
                                                             const std::vector<int>& cpus);

/// Gives the calling thread a real-time level. Returns the system's error number, or 0.
/// @realtime alloc-free, one system call
[[nodiscard]] int request_level(int level) noexcept;
/// How the system calls the level: "SCHED_FIFO 45".
/// @realtime set-up only
[[nodiscard]] std::string name_of_level(int level);
/// The remedy for that request_level() gave the calling thread less than this level; empty if it did
/// not.
/// @realtime set-up only
[[nodiscard]] std::string remedy_of_level(int level);
/// The error for when request_level() has failed.
/// @realtime set-up only
[[nodiscard]] SetupError level_refusal(const std::string& subject, int level, int error);

/// Makes the calling thread yield to every other one; false if the system can't.
/// @realtime set-up only
[[nodiscard]] bool yield_to_all() noexcept;

}  // namespace rtpm::rt::os
