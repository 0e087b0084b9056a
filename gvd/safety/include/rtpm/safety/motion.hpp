#pragma once

#include "rtpm/driver/geometry.hpp"

namespace rtpm::gvd {

/// The device's last cycle as the safety filter sees it, in the device's frame.
/// @ownership a value
struct Motion {
  driver::Vector3 position_m{};
  driver::Twist twist{};
  driver::Wrench wrench_applied{};  ///< The wrench that the actuators apply.
};

}  // namespace rtpm::gvd
