#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A listening TCP socket.   Set-up only, except accept(): not for lanes.
class TcpListener {
 public:
  /// Port 0: the system chooses. Errors: the port is taken, the address is not this host's.
  [[nodiscard]] static expected<TcpListener, SetupError> open(const std::string& host,
                                                              std::uint16_t port);
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// The next connection, ready for FrameStream. One for which no descriptor is left is ended.
  [[nodiscard]] Accepted accept() noexcept;

 private:
  TcpListener(Descriptor socket, std::uint16_t port) noexcept;

  Descriptor socket_;
  Descriptor spare_;  ///< Given up for a moment when no other is left.
  std::uint16_t port_;
};

/// Sets what every RTPM connection has: no delay by Nagle, keep-alive, an end after 3 s without
/// acknowledgement, room for a full window of replies.
void prepare_stream(int socket) noexcept;

/// Has polls report the stream only when `size` bytes are there, or its end. 1 is the usual.
void report_from(int socket, std::size_t size) noexcept;

/// Copies what has arrived to the begin of `to` and leaves it in the stream; gives how much, 0 at
/// the stream's end.   Never blocks.
[[nodiscard]] std::size_t peek(int socket, MutableBytes to) noexcept;

}  // namespace rtpm::transport
