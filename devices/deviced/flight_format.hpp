#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::deviced {

/// The file extension of this build's flight records: ".mcap", or ".csv" without rtpm::capture.
[[nodiscard]] std::string_view flight_file_ending() noexcept;
/// Describes such a file: "a recording in the format MCAP".
[[nodiscard]] std::string_view flight_file_kind() noexcept;

/// Writes a flight record. An existing file with that name is replaced once the new one is
/// complete.
/// @realtime never
/// @errors   the file can't be written; described in words
[[nodiscard]] expected<void, SetupError> write_flight(const std::string& path,
                                                      const std::string& device,
                                                      const gvd::FlightLog& log);

}  // namespace rtpm::deviced
