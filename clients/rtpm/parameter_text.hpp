#pragma once

#include <string>
#include <vector>

#include "rtpm/configuration/client.hpp"

namespace rtpm::tool {

/// Every parameter with all that is known of it, as an aligned table; escaped.
[[nodiscard]] std::string table_of(const gvd::DeviceConfiguration& configuration);

/// "safety.ramp_s=0.02" and a line feed, for each; `rtpm config set` takes it. Escaped.
[[nodiscard]] std::string lines_of(const std::vector<driver::ParameterSetting>& settings);

}  // namespace rtpm::tool
