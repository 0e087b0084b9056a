#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "rtpm/device_hid/transport.hpp"

/// The operating system's knowledge of a HID device, beyond hidapi's. Implemented in os/.
namespace rtpm::device_hid {

/// How the system changes the sizes of a device's reports.
struct ReportSizes {
  /// The size of an input report by its first byte, to which it is cut: Windows fills each report up
  /// to the longest one. 0 leaves the report as it is.
  std::array<std::uint16_t, 256> inputs{};
  /// Longer output reports are cut to this size, as Windows refuses them.
  std::size_t output_max = std::numeric_limits<std::size_t>::max();
  std::size_t feature_min = 0;  ///< Windows refuses shorter buffers for a feature report.
};

/// The port of the device at `node`; empty if it is unknown.
/// @realtime set-up only
[[nodiscard]] std::string port_of(const std::string& node);

/// The report descriptor of the device at `node`; empty if it can't be read.
/// @realtime set-up only
[[nodiscard]] std::vector<std::byte> report_descriptor_of(const std::string& node);

/// @realtime set-up only
[[nodiscard]] ReportSizes report_sizes_of(const Unit& unit);

}  // namespace rtpm::device_hid
