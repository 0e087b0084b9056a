#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::device_falcon {

/// A Falcon on this machine's USB.
struct Unit {
  std::string serial;  ///< Empty: it has none, or it can't be read.
  std::string port;    ///< Where it is plugged in, as the kernel names it: "1-2.3".
  std::string node;    ///< "/dev/bus/usb/001/004"; another one each time it is plugged in.
};

/// Which unit is meant. Empty words say nothing.
struct UnitChoice {
  std::string serial{};
  std::string port{};
};

/// The one of `units` that is meant. A serial number counts only where it is one unit's.
/// @return its index
/// @errors   none, or more than one: in words with those that are there
[[nodiscard]] expected<std::size_t, SetupError> choose(const std::vector<Unit>& units,
                                                       const UnitChoice& choice);

}  // namespace rtpm::device_falcon
