#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_hid/transport.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_hid {

/// A driver from an operator's words, as read_settings() reads them. It opens no device yet.
/// @param device_name  "pad0": the frame is "pad0/base"
/// @realtime set-up only
/// @errors   an unknown word; several devices fit; none is plugged in, and kind= is not given
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The units that this driver takes, each with the controls that it leaves out, and the units that
/// could be a game pad but are not served, with the reason.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> found_among(const std::vector<Unit>& units);

/// The result of found_among() for the units that are plugged in now.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_hid
