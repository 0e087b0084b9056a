#pragma once

#include "verbs.hpp"

namespace rtpm::tool {

/// take-over DEVICE [TRANSITION]: takes a device's lease as its operator, makes the transition, and
/// keeps the lease until Ctrl-C, for Request::stream_time, or until the idle lease expires.
[[nodiscard]] int take_over(const Request& request);

/// stop: stops every device that the registry names, and all others of their system.
/// stop DEVICE [SCOPE]: stops that device, its server's devices, or the system's.
[[nodiscard]] int stop_devices(const Request& request);

/// flight-record DEVICE: prints the cycles around the device's newest fault as CSV.
[[nodiscard]] int flight_record(const Request& request);

}  // namespace rtpm::tool
