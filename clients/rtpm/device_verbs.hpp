#pragma once

#include "verbs.hpp"

namespace rtpm::tool {

/// take-over DEVICE [TRANSITION]: takes the lease of a device as its operator, has the device make
/// the transition, and keeps the lease until Ctrl-C, Request::stream_time is over, or the device
/// ends it because nothing was commanded.
[[nodiscard]] int take_over(const Request& request);

}  // namespace rtpm::tool
