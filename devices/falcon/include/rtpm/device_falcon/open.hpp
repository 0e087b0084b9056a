#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_falcon {

/// Creates a driver for the unit that `arguments` select: "serial=FALCON01", "port=1-2.3", and
/// "firmware=FILE", whose value includes all following text. Without serial number and port, it
/// uses the only plugged-in unit and then stays with that unit.
/// @realtime set-up only
/// @errors   an unknown word; a file that can't be read or is not firmware. A unit that is not
///           plugged in is an error only in configure()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The plugged-in units. Needs no permission; a machine without USB has none.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_falcon
