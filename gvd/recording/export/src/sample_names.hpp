#pragma once

#include <string>

#include "rtpm/driver/descriptor.hpp"

namespace rtpm::exports {

struct ColumnName {
  std::string name{};  ///< Empty for an element that the device does not have.
  std::string unit{};  ///< Empty if none is stated.
};

/// The name and unit of a sample's column: elements of arrays have those of the device's parts.
/// @param column  "joints[0]"
[[nodiscard]] ColumnName name_by_device(const driver::Descriptor& device,
                                        const std::string& column);

}  // namespace rtpm::exports
