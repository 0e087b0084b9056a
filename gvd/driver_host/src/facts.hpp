#pragma once

#include <vector>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver_host {

/// The constant facts of a driver, asked for once.
/// @ownership a value
struct Facts {
  driver::Descriptor descriptor;
  std::vector<driver::ParameterSpec> parameters;
  std::vector<driver::CalibrationInfo> calibrations;
};

}  // namespace rtpm::driver_host
