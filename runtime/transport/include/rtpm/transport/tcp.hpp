#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A listening TCP socket.
/// @realtime set-up only, except accept(); not for lanes
class TcpListener {
 public:
  /// @param host  numeric, a name, or "any": every address of this host
  /// @param port  0: the system chooses
  /// @errors   the port is taken, the address is not this host's
  [[nodiscard]] static expected<TcpListener, SetupError> open(const std::string& host,
                                                              std::uint16_t port);
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// The next connection, ready for FrameStream. Closes it if no descriptor is left.
  [[nodiscard]] Accepted accept() noexcept;

 private:
  TcpListener(Descriptor socket, std::uint16_t port) noexcept;

  Descriptor socket_;
  Descriptor spare_;  ///< Closed for a moment when no other descriptor is left.
  std::uint16_t port_;
};

/// Sets the options of every RTPM connection: no Nagle delay, keep-alive, an end after 3 s without
/// acknowledgement, a send buffer for a full window of replies.
void prepare_stream(int socket) noexcept;

/// Lets polls report the stream only once `size` bytes have arrived, or its end. The default is 1.
void report_from(int socket, std::size_t size) noexcept;

/// Copies the bytes that have arrived to `to` without taking them from the stream. Never blocks.
/// @return the number of bytes; 0 if there are none, or at the stream's end
[[nodiscard]] std::size_t peek(int socket, MutableBytes to) noexcept;

}  // namespace rtpm::transport
