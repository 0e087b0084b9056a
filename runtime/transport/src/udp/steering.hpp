#pragma once

#include <cstdint>

namespace rtpm::transport {

/// Where steer() finds a datagram's priority, two bytes, little-endian: the header's (hp-11-2).
inline constexpr std::uint32_t kPriorityOffset = 4;

}  // namespace rtpm::transport
