#pragma once

#include <cstdint>
#include <string>

#include "rtpm/rpc/lane_table.hpp"

namespace rtpm::tool {

/// A time in a suitable unit: "12.3 us".
[[nodiscard]] std::string time_text(std::int64_t ns);

/// The number of dropped frames, for all reasons together.
[[nodiscard]] std::uint64_t dropped_count(const wire::FrameCounters& frames);

/// Such as "lab-devices@127.0.0.1:4711"; safe to print.
[[nodiscard]] std::string server_text(const rpc::LaneTable& table);

}  // namespace rtpm::tool
