#pragma once

#include <memory>
#include <vector>

#include "rtpm/device_falcon/transport.hpp"
#include "rtpm/device_falcon/units.hpp"

namespace rtpm::device_falcon {

/// The units on this machine's USB.
/// @errors   libusb does not start
[[nodiscard]] expected<std::vector<Unit>, SetupError> find_units();

/// Opens a unit through libusb. Its transfers are asynchronous, and their memory is allocated here;
/// the thread that calls receive() is the only one that handles libusb's events.
/// @errors   in words with the remedy: a missing right, with the udev rule that gives it; in use
[[nodiscard]] expected<std::unique_ptr<Transport>, SetupError> open_usb(const Unit& unit);

}  // namespace rtpm::device_falcon
