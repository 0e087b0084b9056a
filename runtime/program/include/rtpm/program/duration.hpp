#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::program {

/// Parses a decimal number of at least 0 with a unit, rounded to the nanosecond: "800us", "2 s".
/// The units are ns, us, ms, s, min and h; "0" needs none.
/// @return nullopt if `text` is malformed or exceeds a Duration (292 years)
/// @realtime set-up only
[[nodiscard]] std::optional<Duration> parse_duration(std::string_view text);

/// Formats `duration` (at least 0) in the largest exact unit; parse_duration() restores it.
/// @realtime set-up only
[[nodiscard]] std::string duration_text(Duration duration);

}  // namespace rtpm::program
