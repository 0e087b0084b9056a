#pragma once

#include <string>

#include "cli/context.hpp"
#include "rtpm/gvd/client.hpp"

namespace rtpm::tool {

/// Opens a device by its name or URL, within --deadline.
/// @errors   those of gvd::DeviceClient::open(), with the name; for an unbound name, also similar
///           names
[[nodiscard]] expected<gvd::DeviceClient, SetupError> open_device(Context& context,
                                                                  const std::string& name);

}  // namespace rtpm::tool
