#pragma once

#include "rtpm/driver/geometry.hpp"

namespace rtpm::gvd {

/// What the safety filter knows of the device's last cycle, in the device's frame.
/// @ownership a value
struct Motion {
  driver::Vector3 position_m{};
  driver::Twist twist{};
  driver::Wrench wrench_applied{};  ///< By the actuators.
};

}  // namespace rtpm::gvd
