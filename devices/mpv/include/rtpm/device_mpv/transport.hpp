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
  std::size_t size = 0;    ///< Bytes; 0 if none came within the patience.
  bool is_closed = false;  ///< The player is gone.
};

/// A stream of bytes to and from one player, and the clock for waiting on it.
/// @threads  one at a time
/// @realtime set-up only
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  /// Ends the connection, and a player that it started.
  virtual ~Transport() = default;

  /// Sends all of `bytes`, without waiting.
  /// @return false if the player is gone, or has not read for so long that the buffer is full
  [[nodiscard]] virtual bool send(std::string_view bytes) = 0;
  /// Waits for bytes, at most `patience`.
  [[nodiscard]] virtual Received receive(std::span<char> buffer, Duration patience) = 0;
  /// The present time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// Starts or joins a player.
/// @errors   in words with the remedy
using OpenTransport = std::function<expected<std::unique_ptr<Transport>, SetupError>()>;

}  // namespace rtpm::device_mpv
