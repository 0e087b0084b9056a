#pragma once

#include <cstdint>
#include <string>

namespace rtpm::transport {

/// Why nothing was sent or received.
enum class IoError : std::uint8_t {
  kNothing,  ///< Nothing is there now. Wait, then try again.
  kFull,     ///< The system's buffer is full; nothing was sent. On a stream: end the connection.
  kRefused,  ///< The host answered that nobody has the port.
  kClosed,   ///< The peer closed the stream, or it broke. Open another.
  kFailed,   ///< The system refused for another reason.
  kBroken,   ///< The memory shared with the peer holds nonsense. End the connection.
};

/// Why set-up failed: one sentence that names the thing, the cause and the remedy.
struct TransportError {
  std::string text;
  /// The system has no descriptor or memory left for it: nothing was tried, and the peer may well
  /// be there.
  bool is_exhausted = false;
};

}  // namespace rtpm::transport
