#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/replay/recorded.hpp"

namespace rtpm::replay {

/// A message's time since `begin_ns`, the first log time of its recording: its publish time, or the
/// log time if that is not plausible. Stamps may have any value; out of range, they are clamped.
[[nodiscard]] Duration time_of(std::uint64_t log_time_ns, std::uint64_t publish_time_ns,
                               std::uint64_t begin_ns) noexcept;

/// Makes times relative to the first of them, not to the start of the file, and mends clocks that
/// jump: a time that goes back within a track becomes the one before, a pause of more than
/// kPauseMax in all tracks is shortened. Reports both in `recorded.notes`, and sorts the events.
void mend_times(Recorded& recorded);

}  // namespace rtpm::replay
