#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/socket.hpp"

/// Single datagrams between hosts of a LAN, in any direction: for queries to a multicast group or a
/// host, and their answers. IPv4 only.
namespace rtpm::transport {

/// An interface of this host with an IPv4 address.
struct NetworkInterface {
  std::string name{};
  std::string address{};  ///< "192.168.7.2".
};

/// The active interfaces with this name or address that support multicast and are not loopback;
/// "any" for all of them.
/// @realtime set-up only
/// @errors   there is no such interface; the text lists the existing ones
[[nodiscard]] expected<std::vector<NetworkInterface>, SetupError> multicast_interfaces(
    std::string_view wanted);

/// The source or destination of a datagram.
struct LanPeer {
  std::uint32_t ipv4 = 0;  ///< 127.0.0.1 is 0x7f000001.
  std::uint16_t port = 0;
  friend bool operator==(const LanPeer&, const LanPeer&) = default;
};

/// Such as "192.168.7.2:7423", or without the port.
[[nodiscard]] std::string to_string(const LanPeer& peer);
[[nodiscard]] std::string address_text(std::uint32_t ipv4);
/// Parses a numeric address; 0 if `text` is not one.
[[nodiscard]] std::uint32_t parse_address(const std::string& text) noexcept;

/// @threads  one at a time
class LanSocket {
 public:
  /// Opens a socket on this host's `address` ("0.0.0.0": all) at `port` (0: any free one), which
  /// can also send to multicast groups within the LAN (TTL 1). Several programs on this host may
  /// open the same port; a datagram goes to the latest.
  /// @realtime set-up only
  /// @errors   the address is not this host's; no descriptor left
  [[nodiscard]] static expected<LanSocket, SetupError> open(const std::string& address,
                                                            std::uint16_t port = 0);
  /// Receives the datagrams to the group at `port` that arrive at one of the interfaces. Several
  /// programs on a host may join.
  /// @realtime set-up only
  /// @errors   an interface refuses; another program has the port exclusively
  [[nodiscard]] static expected<LanSocket, SetupError> join(
      const std::string& group, std::uint16_t port,
      const std::vector<NetworkInterface>& interfaces);

  /// @return whether the system accepted it
  bool send(ConstBytes datagram, const LanPeer& to) noexcept;
  /// Returns the next datagram, a view of `buffer`, and its sender. Empty if there is none, or if
  /// it does not fit: then `from.port` is not 0.
  [[nodiscard]] ConstBytes receive(MutableBytes buffer, LanPeer& from) noexcept;
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// The socket's own address and port.
  [[nodiscard]] LanPeer name() const noexcept;

 private:
  explicit LanSocket(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  Descriptor socket_;
};

/// Waits until one of the sockets is readable, or until `until`.
void wait_for_any(const std::vector<LanSocket>& sockets, MonotonicTime until) noexcept;

}  // namespace rtpm::transport
