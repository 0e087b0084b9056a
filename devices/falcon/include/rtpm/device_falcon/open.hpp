#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_falcon {

/// A driver for the unit that `arguments` name: "serial=FALCON01", "port=1-2.3", and
/// "firmware=FILE", whose value takes the rest of the text. Without serial and port it takes the
/// only unit that is plugged in, and stays with that one.
/// @realtime set-up only
/// @errors   an unknown word, a file that can't be read or is not firmware; a unit that is not
///           plugged in is an error of configure() only
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The units that are plugged in now. Needs no right; a machine without USB has none.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_falcon
