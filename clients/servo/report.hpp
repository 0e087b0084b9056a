#pragma once

#include <string>

#include "loop.hpp"
#include "rtpm/base/histogram.hpp"

/// What rtpm-servo shows: texts only, printed elsewhere.
namespace rtpm::servo {

/// One line on what the loop does at the moment: position, force, contact, latency so far.
/// Set-up only.
[[nodiscard]] std::string live_text(const Live& live, const LatencyHistogram& cycles,
                                    Duration since_start);

/// The table of latencies with the paper's figures beside it.   Set-up only.
[[nodiscard]] std::string table_text(const Statistics& statistics);

}  // namespace rtpm::servo
