#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::options {

/// The time that `text` says: a decimal number of at least 0 and a unit, "800us", "1.5ms", "2 s";
/// units are ns, us, ms, s, min and h; "0" needs none. Rounded to the nanosecond. Nothing if it is
/// not that, or more than a Duration holds (292 years).   Set-up only.
[[nodiscard]] std::optional<Duration> parse_duration(std::string_view text);

/// `duration` (at least 0) in the largest unit that says it exactly: "800us", "2s";
/// parse_duration() reads it back unchanged.   Set-up only.
[[nodiscard]] std::string duration_text(Duration duration);

}  // namespace rtpm::options
