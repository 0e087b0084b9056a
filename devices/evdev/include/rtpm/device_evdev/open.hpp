#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_evdev/transport.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_evdev {

/// A driver of an input device of this machine. Its channels are those of the device as it is now;
/// if the device is not plugged in, those of a game pad.
/// @param arguments    as read_settings() takes them
/// @param device_name  "wheel0"; its frame is "wheel0/base"
/// @realtime set-up only
/// @errors   faults of the arguments, in words with the remedy
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The joysticks, game pads, wheels and other devices with axes or force feedback that are plugged
/// in. Keyboards and mice are left out; `node=` takes them all the same.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

/// The input devices of this machine, through libudev and libevdev.
[[nodiscard]] Access machine_access();

}  // namespace rtpm::device_evdev
