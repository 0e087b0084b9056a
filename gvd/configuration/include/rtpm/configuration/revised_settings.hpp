#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/driver/parameter.hpp"

namespace rtpm::gvd {

/// Values of parameters, and the revision of the configuration that has them.
/// @ownership a value
struct RevisedSettings {
  std::uint64_t revision = 0;
  std::vector<driver::ParameterSetting> settings{};
};

}  // namespace rtpm::gvd
