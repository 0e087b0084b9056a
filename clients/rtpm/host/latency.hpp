#pragma once

#include <string>

#include "cli/context.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::tool {

/// Measures the loop from a stimulus to the sample that shows it: sets each output of `device`
/// repeatedly, and waits for the sensor of `device` that follows. Prints a row per output.
/// @return an exit code
int measure_latency(Context& context, const std::string& device);

/// The newest figures of each device that was measured on this host, for a recording's metadata
/// "rtpm.latency"; without values if there are none.
[[nodiscard]] recording::Metadata kept_latency();

}  // namespace rtpm::tool
