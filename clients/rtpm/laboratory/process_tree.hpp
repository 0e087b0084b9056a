#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// A process, told from a later one with the same number by when it started.
struct ProcessIdentity {
  pid_t id = 0;
  std::uint64_t start_ticks = 0;  ///< Of the system, since its boot.
  friend bool operator==(const ProcessIdentity&, const ProcessIdentity&) = default;
};

/// The process of that number; nothing: there is none, or it is a zombie.
[[nodiscard]] std::optional<ProcessIdentity> identity_of(pid_t id);

/// All processes below that one, as far as this user sees them.
[[nodiscard]] std::vector<ProcessIdentity> descendants_of(pid_t id);

/// Sends a signal to that process, and to no later one with its number.
/// @return whether it was there
bool send_signal(const ProcessIdentity& process, int signal);

/// Makes this process the parent of what its descendants leave behind.
void adopt_orphans();

/// Ends all descendants of this process: SIGTERM, after `patience` SIGKILL. Reaps them.
/// @return whether none is left, within 2 s of SIGKILL
bool end_descendants(Duration patience);

}  // namespace rtpm::laboratory
