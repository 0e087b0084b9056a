#pragma once

#include <string>

#include "cli/output.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// The lateness of a thread that sleeps until a given time.
struct WakeUps {
  LatencyHistogram lateness{};
  bool is_realtime = false;  ///< Measured at SCHED_FIFO; if false, time-shared.
};

/// Measures at 1 kHz for `time`, or until the stop signal, at SCHED_FIFO if that is granted.
/// @errors   no thread could be started
[[nodiscard]] expected<WakeUps, SetupError> measure_wake_ups(Duration time,
                                                             const options::StopSignal& stop);

/// Whether the lateness is good enough for a loop of 1 kHz.
[[nodiscard]] rt::Finding judge(const WakeUps& wake_ups);
/// A sentence, and a histogram with a row for each power of two.
[[nodiscard]] std::string text_of(const WakeUps& wake_ups);
[[nodiscard]] Json json_of(const WakeUps& wake_ups);

}  // namespace rtpm::tool
