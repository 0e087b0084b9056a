#pragma once

#include <cstdint>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::transport {

/// Why nothing was sent or received.
enum class IoError : std::uint8_t {
  kNothing,  ///< Nothing has arrived. Wait, then try again.
  kFull,     ///< The system's buffer is full; nothing was sent. On a stream: end the connection.
  kRefused,  ///< The host answered that the port is closed.
  kClosed,   ///< The peer closed the stream, or it broke. Open a new one.
  kFailed,   ///< The system refused for another reason.
  kBroken,   ///< The shared memory is invalid. End the connection.
};

}  // namespace rtpm::transport
