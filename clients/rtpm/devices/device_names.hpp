#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cli/context.hpp"

namespace rtpm::tool {

inline constexpr std::string_view kDeviceInterface = "rtpm.device.Device";

/// The names of all devices at the registry.
/// @errors   the registry does not answer
[[nodiscard]] expected<std::vector<std::string>, SetupError> device_names(Context& context);

}  // namespace rtpm::tool
