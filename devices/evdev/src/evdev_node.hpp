#pragma once

#include <memory>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::device_evdev {

/// Opens the device node of `unit` with libevdev.
/// @errors   described in words; for a missing permission, with the udev rule that grants it
[[nodiscard]] expected<std::unique_ptr<Transport>, SetupError> open_node(const Unit& unit,
                                                                         bool is_grabbed);

}  // namespace rtpm::device_evdev
