#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// A process; its start time tells it from a later one with the same number.
struct ProcessIdentity {
  pid_t id = 0;
  std::uint64_t start_ticks = 0;  ///< Clock ticks since the system's boot.
  friend bool operator==(const ProcessIdentity&, const ProcessIdentity&) = default;
};

/// The process with that number; nullopt if there is none, or it is a zombie.
[[nodiscard]] std::optional<ProcessIdentity> identity_of(pid_t id);

/// All descendants of that process that this user can see.
[[nodiscard]] std::vector<ProcessIdentity> descendants_of(pid_t id);

/// Sends a signal to that process, never to a later one with its number.
/// @return whether it still existed
bool send_signal(const ProcessIdentity& process, int signal);

/// Makes this process the parent of its orphaned descendants.
void adopt_orphans();

/// Ends all descendants of this process: SIGTERM, then SIGKILL after `patience`. Reaps them.
/// @return whether all have ended, within 2 s of SIGKILL
bool end_descendants(Duration patience);

}  // namespace rtpm::laboratory
