#pragma once

#include <vector>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver_host {

/// The constant properties of a driver, queried once.
/// @ownership a value
struct Facts {
  driver::Descriptor descriptor;
  std::vector<driver::ParameterSpec> parameters;
  std::vector<driver::CalibrationInfo> calibrations;
};

}  // namespace rtpm::driver_host
