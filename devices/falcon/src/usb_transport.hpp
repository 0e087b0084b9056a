#pragma once

#include <memory>
#include <vector>

#include "rtpm/device_falcon/transport.hpp"
#include "rtpm/device_falcon/units.hpp"

namespace rtpm::device_falcon {

/// The Falcon units on this machine's USB.
/// @errors   libusb can't be initialized
[[nodiscard]] expected<std::vector<Unit>, SetupError> find_units();

/// Opens a unit through libusb. Its transfers are asynchronous, and their memory is allocated here.
/// Only the thread that calls receive() handles libusb's events.
/// @errors   a missing permission, with the udev rule that grants it; in use; described in words
///           with the remedy
[[nodiscard]] expected<std::unique_ptr<Transport>, SetupError> open_usb(const Unit& unit);

}  // namespace rtpm::device_falcon
