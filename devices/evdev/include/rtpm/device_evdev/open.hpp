#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_evdev/transport.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_evdev {

/// Creates a driver for an input device of this machine. Its channels are those that the device has
/// now; if it is not plugged in, those of a game pad.
/// @param arguments    in the format of read_settings()
/// @param device_name  for example "wheel0"; its frame is then "wheel0/base"
/// @realtime set-up only
/// @errors   faults in the arguments, described in words with the remedy
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The plugged-in joysticks, game pads, wheels and other devices with axes or force feedback.
/// Keyboards and mice are left out, but `node=` accepts them.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

/// The input devices of this machine, through libudev and libevdev.
[[nodiscard]] Access machine_access();

}  // namespace rtpm::device_evdev
