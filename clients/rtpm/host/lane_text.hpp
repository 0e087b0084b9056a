#pragma once

#include <cstdint>
#include <string>

#include "rtpm/rpc/lane_table.hpp"

namespace rtpm::tool {

/// A time in the unit that suits it: "12.3 us".
[[nodiscard]] std::string time_text(std::int64_t ns);

/// Frames that were dropped, for whatever reason.
[[nodiscard]] std::uint64_t dropped_count(const wire::FrameCounters& frames);

/// "lab-devices@127.0.0.1:4711", safe to print.
[[nodiscard]] std::string server_text(const rpc::LaneTable& table);

}  // namespace rtpm::tool
