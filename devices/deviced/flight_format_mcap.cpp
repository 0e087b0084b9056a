#include "flight_format.hpp"
#include "rtpm/capture/flight_file.hpp"

namespace rtpm::deviced {

std::string_view flight_file_ending() noexcept {
  return ".mcap";
}

std::string_view flight_file_kind() noexcept {
  return "a recording in the format MCAP";
}

expected<void, SetupError> write_flight(const std::string& path, const std::string& device,
                                        const gvd::FlightLog& log) {
  return capture::write_flight_file(path, device, log, recording::Existing::kReplace);
}

}  // namespace rtpm::deviced
