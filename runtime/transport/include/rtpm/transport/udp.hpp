#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

/// A datagram and where it came from.
struct Datagram {
  ConstBytes bytes{};
  wire::PeerAddress peer{};
};

/// A lane's UDP socket. All lanes of a server share one port: the kernel steers each datagram to
/// the lane of its priority (see steer()).
/// Threads: one at a time.
class UdpPort {
 public:
  /// Opens the port for a server's first lane (or, with `joins`, for a further one).   Set-up only.
  /// Errors: the port is taken, the address is not this host's.
  [[nodiscard]] static expected<UdpPort, TransportError> open(const std::string& host,
                                                              std::uint16_t port, Priority priority,
                                                              bool joins);

  /// One datagram into `buffer`; a longer one is cut, so leave a byte to notice.
  /// RT: alloc-free, one syscall, never blocks.
  [[nodiscard]] expected<Datagram, IoError> receive(MutableBytes buffer) noexcept;
  /// RT: alloc-free, one syscall, never blocks.
  [[nodiscard]] expected<void, IoError> send(const wire::PeerAddress& peer,
                                             ConstBytes frame) noexcept;
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }

 private:
  explicit UdpPort(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  Descriptor socket_;
};

/// Has the kernel hand each datagram to the lane that serves the priority in its header.
/// `lane_lows` are the lowest priorities of the lanes, ascending from 0, in the order in which
/// their ports were opened; `any_lane` is one of those ports.   Set-up only. Source:
/// SO_ATTACH_REUSEPORT_CBPF, socket(7); the priority's offset is spec/hprotocol.md#hp-2's.
[[nodiscard]] expected<void, TransportError> steer(const UdpPort& any_lane,
                                                   std::span<const Priority> lane_lows);

}  // namespace rtpm::transport
