#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::capture {

/// Writes a device's flight record as a recording: a channel `DEVICE/flight` with one message per
/// cycle, a FlatBuffer whose root is the table rtpm.device.FlightCycle. A message's log and publish
/// time are the cycle's, converted to UTC by the current wall clock. The metadata "rtpm.flight" has
/// device, cause, number, fault_cycle and cycle_count. A failed write leaves no file.
/// @realtime never
/// @errors   described in words: the file exists, no such folder, no permission, the disk is full
[[nodiscard]] expected<void, SetupError> write_flight_file(
    const std::string& path, const std::string& device, const gvd::FlightLog& log,
    recording::Existing existing = recording::Existing::kRefuse);

}  // namespace rtpm::capture
