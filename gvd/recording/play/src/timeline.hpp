#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/replay/recorded.hpp"

namespace rtpm::replay {

/// A message's time since `begin_ns`, the recording's first log time: its publish time, or the log
/// time if that is implausible. Stamps may have any value; they are clamped to the valid range.
[[nodiscard]] Duration time_of(std::uint64_t log_time_ns, std::uint64_t publish_time_ns,
                               std::uint64_t begin_ns) noexcept;

/// Makes times relative to the first one instead of the start of the file, and corrects clock
/// jumps: a time that goes back within a track becomes the previous one, and a pause of more than
/// kPauseMax in all tracks is shortened. Reports both in `recorded.notes`, and sorts the events.
void mend_times(Recorded& recorded);

}  // namespace rtpm::replay
