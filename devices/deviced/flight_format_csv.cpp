#include "flight_format.hpp"
#include "rtpm/rt/durable_file.hpp"

namespace rtpm::deviced {

std::string_view flight_file_ending() noexcept {
  return ".csv";
}

std::string_view flight_file_kind() noexcept {
  return "a CSV file (this build lacks rtpm::capture, which writes MCAP)";
}

expected<void, SetupError> write_flight(const std::string& path, const std::string& /*device*/,
                                        const gvd::FlightLog& log) {
  if (const auto written = rt::replace_file(path, to_csv(log)); !written) {
    return setup_error(path + " can't be written", written.error());
  }
  return {};
}

}  // namespace rtpm::deviced
