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
  /// @param port  0 lets the system choose
  /// @errors   the port is taken; the address does not belong to this host
  [[nodiscard]] static expected<TcpListener, SetupError> open(const std::string& host,
                                                              std::uint16_t port);
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Accepts the next connection, ready for FrameStream. Closes it if no descriptor is left.
  [[nodiscard]] Accepted accept() noexcept;

 private:
  TcpListener(Descriptor socket, std::uint16_t port) noexcept;

  Descriptor socket_;
  Descriptor spare_;  ///< Closed temporarily when no other descriptor is left.
  std::uint16_t port_;
};

/// Sets the options of every RTPM connection: no Nagle delay, keep-alive, end after 3 s without
/// acknowledgement, a send buffer for a full window of replies.
void prepare_stream(int socket) noexcept;

/// Makes polls report the stream only once `size` bytes have arrived, or it has ended. The default
/// is 1.
/// @return false if the system has no such setting: polls report the first byte
[[nodiscard]] bool report_from(int socket, std::size_t size) noexcept;

/// Copies received bytes to `to` without consuming them. Never blocks.
/// @return the number of bytes; 0 if there are none, or the stream has ended
[[nodiscard]] std::size_t peek(int socket, MutableBytes to) noexcept;

}  // namespace rtpm::transport
