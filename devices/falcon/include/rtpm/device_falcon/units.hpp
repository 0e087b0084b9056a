#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::device_falcon {

/// A Falcon on this machine's USB.
struct Unit {
  std::string serial;  ///< Empty if it has none, or it can't be read.
  std::string port;    ///< The kernel's name of its port: "1-2.3".
  std::string node;    ///< "/dev/bus/usb/001/004"; another one each time it is plugged in.
};

/// The choice of a unit. Empty members match any unit.
struct UnitChoice {
  std::string serial{};
  std::string port{};
};

/// Finds the unit that `choice` means. A serial number counts only if one unit alone has it.
/// @return its index in `units`
/// @errors   no unit, or more than one; the text names the units that are plugged in
[[nodiscard]] expected<std::size_t, SetupError> choose(const std::vector<Unit>& units,
                                                       const UnitChoice& choice);

}  // namespace rtpm::device_falcon
