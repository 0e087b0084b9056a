#pragma once

#include <string>
#include <string_view>

#include "rtpm/driver/descriptor.hpp"

namespace rtpm::ros2 {

/// A device's descriptor as YAML, for the topic `description`.
[[nodiscard]] std::string description_text(std::string_view name,
                                           const driver::Descriptor& descriptor);

}  // namespace rtpm::ros2
