#pragma once

#include <string>

#include "cli/output.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// How late a thread wakes that sleeps until a given time.
struct WakeUps {
  LatencyHistogram lateness{};
  bool is_realtime = false;  ///< Measured at SCHED_FIFO; otherwise time-shared.
};

/// Measures at 1 kHz for `time`, or until the stop signal, at SCHED_FIFO if granted.
/// @errors   no thread could be started
[[nodiscard]] expected<WakeUps, SetupError> measure_wake_ups(Duration time,
                                                             const program::StopSignal& stop);

/// Judges whether the lateness is good enough for a 1 kHz loop.
[[nodiscard]] rt::Finding judge(const WakeUps& wake_ups);
/// A sentence, and a histogram with one row per power of two.
[[nodiscard]] std::string text_of(const WakeUps& wake_ups);
[[nodiscard]] Json json_of(const WakeUps& wake_ups);

}  // namespace rtpm::tool
