#pragma once

#include "verbs.hpp"

namespace rtpm::tool {

/// config list|get|set|save|reset|calibrate DEVICE …: the parameters and calibrations of a device.
[[nodiscard]] int config(const Request& request);

/// The parameters of the object at `url` as comments of a schema; empty if it has none.
/// @errors   the server's configuration gives no answer
[[nodiscard]] expected<std::string, SetupError> parameters_as_comment(const Request& request,
                                                                      const std::string& url);

}  // namespace rtpm::tool
