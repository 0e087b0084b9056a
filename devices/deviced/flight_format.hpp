#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::deviced {

/// How this build writes flight records: ".mcap" or, without rtpm::capture, ".csv".
[[nodiscard]] std::string_view flight_file_ending() noexcept;
/// The kind of such a file: "a recording in the format MCAP".
[[nodiscard]] std::string_view flight_file_kind() noexcept;

/// Writes a flight record; a file of that name is replaced when the new one is whole.
/// @realtime never
/// @errors   in words: the file can't be written
[[nodiscard]] expected<void, SetupError> write_flight(const std::string& path,
                                                      const std::string& device,
                                                      const gvd::FlightLog& log);

}  // namespace rtpm::deviced
