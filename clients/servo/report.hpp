#pragma once

#include <string>

#include "loop.hpp"
#include "rtpm/base/histogram.hpp"

/// Formats the output of rtpm-servo.
namespace rtpm::servo {

/// One line: position, force, contact and median latency so far.
/// @realtime set-up only
[[nodiscard]] std::string live_text(const Live& live, const LatencyHistogram& cycles,
                                    Duration since_start);

/// One line: how the wall was rendered, and its measured stiffness.
/// @realtime set-up only
[[nodiscard]] std::string feel_text(const Feel& feel, const LoopConfig& config);

/// The table of latencies, compared with the paper's figures.
/// @realtime set-up only
[[nodiscard]] std::string table_text(const Statistics& statistics);

}  // namespace rtpm::servo
