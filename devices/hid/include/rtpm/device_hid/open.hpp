#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_hid/transport.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_hid {

/// Creates a driver from the operator's words, see read_settings(). It does not open a device.
/// @param device_name  for example "pad0"; its frame is then "pad0/base"
/// @realtime set-up only
/// @errors   an unknown word; several devices match; none is plugged in, and kind= is not given
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The units that this driver supports, each with the controls that it leaves out; and the units
/// that could be game pads but are not supported, with the reason.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> found_among(const std::vector<Unit>& units);

/// The result of found_among() for the plugged-in units.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_hid
