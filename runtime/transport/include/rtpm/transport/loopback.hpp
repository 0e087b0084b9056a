#pragma once

namespace rtpm::transport {

/// The remedy "bring the loopback interface up: sudo ip link set dev lo up."; null if it is up.
/// @realtime set-up only
[[nodiscard]] const char* remedy_for_loopback();

}  // namespace rtpm::transport
