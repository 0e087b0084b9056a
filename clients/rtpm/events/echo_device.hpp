#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Which samples `rtpm echo DEVICE` prints.
struct DeviceEchoRequest {
  std::string device{};
  double rate_hz = 60;
  std::uint64_t count = 0;         ///< 0 for no limit.
  std::optional<Duration> time{};  ///< If unset, until Ctrl-C.
};

/// Polls a device and prints its samples. @return the exit code
int echo_device(Context& context, const DeviceEchoRequest& request);

}  // namespace rtpm::tool
