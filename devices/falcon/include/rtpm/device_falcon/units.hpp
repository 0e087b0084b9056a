#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::device_falcon {

/// A Falcon on a USB port of this machine.
struct Unit {
  std::string serial;  ///< Empty if the unit has none or it can't be read.
  std::string port;    ///< The kernel's name for the port, such as "1-2.3".
  /// For example "/dev/bus/usb/001/004"; changes each time the unit is plugged in.
  std::string node;
};

/// Selects a unit. Empty members match any unit.
struct UnitChoice {
  std::string serial{};
  std::string port{};
};

/// Finds the unit that `choice` selects. A serial number counts only if it is unique.
/// @return its index in `units`
/// @errors   no unit or more than one; the text lists the plugged-in units
[[nodiscard]] expected<std::size_t, SetupError> choose(const std::vector<Unit>& units,
                                                       const UnitChoice& choice);

}  // namespace rtpm::device_falcon
