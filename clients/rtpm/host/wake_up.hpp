#pragma once

#include <string>

#include "cli/output.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// How late a thread wakes that sleeps until a time.
struct WakeUps {
  LatencyHistogram lateness{};
  bool is_realtime = false;  ///< At SCHED_FIFO; else with everybody else.
};

/// Measures at 1 kHz for `time`, or until the signal to stop, at SCHED_FIFO where that is granted.
/// @errors   no thread is left
[[nodiscard]] expected<WakeUps, SetupError> measure_wake_ups(Duration time,
                                                             const options::StopSignal& stop);

/// Whether that is good enough for a loop of 1 kHz.
[[nodiscard]] rt::Finding judge(const WakeUps& wake_ups);
/// A sentence, and a row of bars for each power of two.
[[nodiscard]] std::string text_of(const WakeUps& wake_ups);
[[nodiscard]] Json json_of(const WakeUps& wake_ups);

}  // namespace rtpm::tool
