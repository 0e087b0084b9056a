#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// The samples that `rtpm echo DEVICE` prints.
struct DeviceEchoRequest {
  std::string device{};
  double rate_hz = 60;
  std::uint64_t count = 0;         ///< No limit if 0.
  std::optional<Duration> time{};  ///< Until Ctrl-C if unset.
};

/// Prints the samples of a device as it polls them. @return the exit code
int echo_device(Context& context, const DeviceEchoRequest& request);

}  // namespace rtpm::tool
