#pragma once

#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/configuration/client.hpp"

namespace rtpm::gvd {

/// Reads a configuration's reply to `list`, such as a recorded one.
/// @return   nullopt if the bytes are malformed
/// @realtime set-up only
[[nodiscard]] std::optional<DeviceConfiguration> configuration_in(ConstBytes list_reply);

}  // namespace rtpm::gvd
