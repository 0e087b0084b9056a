#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_mpv {

/// Result of Transport::receive().
struct Received {
  std::size_t size = 0;    ///< Number of bytes; 0 if none arrived within the patience.
  bool is_closed = false;  ///< The player is gone.
};

/// A byte stream to and from one player, and the clock for waiting on it.
/// @threads  one at a time
/// @realtime set-up only
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  /// Closes the connection and ends the player if this transport started it.
  virtual ~Transport() = default;

  /// Sends all of `bytes` without waiting.
  /// @return false if the player is gone, or if the buffer is full because the player has stopped
  ///         reading
  [[nodiscard]] virtual bool send(std::string_view bytes) = 0;
  /// Waits for bytes for at most `patience`.
  [[nodiscard]] virtual Received receive(std::span<char> buffer, Duration patience) = 0;
  /// The current time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// Starts a player or connects to a running one.
/// @errors   described in words with the remedy
using OpenTransport = std::function<expected<std::unique_ptr<Transport>, SetupError>()>;

}  // namespace rtpm::device_mpv
