#pragma once

#include <vector>

#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::device_evdev {

struct FoundUnit {
  Unit unit{};
  bool is_desktop = false;  ///< A keyboard, mouse or switch that the desktop uses.
};

/// The input devices that udev knows.
/// @realtime set-up only
[[nodiscard]] std::vector<FoundUnit> list_units();

}  // namespace rtpm::device_evdev
