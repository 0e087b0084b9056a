#pragma once

#include <netinet/in.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

/// An IPv4 or IPv6 address with a port, in the form that system calls use.
class SocketAddress {
 public:
  /// Creates an address without a family.
  SocketAddress() noexcept : ipv4_{} {}
  SocketAddress(in_addr address, std::uint16_t port) noexcept;
  SocketAddress(const in6_addr& address, std::uint32_t zone, std::uint16_t port) noexcept;
  /// Parses a numeric address, "127.0.0.1", "::1", "fe80::1%eth0"; nullopt if `host` is not
  /// numeric.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<SocketAddress> parse(const std::string& host,
                                                          std::uint16_t port);
  /// Copies an address from the system, at most kSizeMax bytes.
  [[nodiscard]] static SocketAddress of(const sockaddr& address, socklen_t size) noexcept;

  [[nodiscard]] const sockaddr* native() const noexcept {
    return reinterpret_cast<const sockaddr*>(&ipv6_);
  }
  /// Memory that the system fills with an address, up to kSizeMax.
  [[nodiscard]] sockaddr* native() noexcept { return reinterpret_cast<sockaddr*>(&ipv6_); }
  static constexpr socklen_t kSizeMax = sizeof(sockaddr_in6);
  [[nodiscard]] socklen_t size() const noexcept {
    return is_ipv4() ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
  }
  [[nodiscard]] int family() const noexcept { return ipv4_.sin_family; }
  [[nodiscard]] bool is_ipv4() const noexcept { return ipv4_.sin_family == AF_INET; }
  [[nodiscard]] std::uint16_t port() const noexcept { return ntohs(ipv4_.sin_port); }
  void set_port(std::uint16_t port) noexcept { ipv4_.sin_port = htons(port); }
  [[nodiscard]] in_addr ipv4() const noexcept { return ipv4_.sin_addr; }
  [[nodiscard]] const in6_addr& ipv6() const noexcept { return ipv6_.sin6_addr; }
  /// The interface index, for a link-local IPv6 address.
  [[nodiscard]] std::uint32_t zone() const noexcept { return is_ipv4() ? 0 : ipv6_.sin6_scope_id; }

  /// Whether it is in 127.0.0.0/8 or ::1.
  [[nodiscard]] bool is_loopback() const noexcept {
    constexpr std::uint32_t kLoopbackNet = 127;
    if (is_ipv4()) return ntohl(ipv4_.sin_addr.s_addr) >> 24 == kLoopbackNet;
    return IN6_IS_ADDR_LOOPBACK(&ipv6_.sin6_addr);
  }
  /// Whether it is 0.0.0.0 or ::.
  [[nodiscard]] bool is_unspecified() const noexcept;
  /// Whether it is in fe80::/10.
  [[nodiscard]] bool is_link_local() const noexcept;
  /// The numeric address without port: "127.0.0.1", "fe80::1%eth0".
  /// @realtime set-up only
  [[nodiscard]] std::string host() const;
  /// "127.0.0.1:4711", "[::1]:4711".
  /// @realtime set-up only
  [[nodiscard]] std::string text() const;

  /// The address in the protocol's form. An IPv4 address mapped into IPv6 becomes IPv4.
  [[nodiscard]] wire::PeerAddress peer() const noexcept {
    if (!is_ipv4()) return ipv6_peer();
    return {0, ipv4_.sin_addr.s_addr, ipv4_.sin_port};
  }
  /// The reverse of peer().
  [[nodiscard]] static SocketAddress of(const wire::PeerAddress& peer) noexcept {
    if (peer.high != 0 || peer.low >> 32 != 0) return of_ipv6_peer(peer);
    SocketAddress address;
    address.ipv4_.sin_family = AF_INET;
    address.ipv4_.sin_port = static_cast<in_port_t>(peer.port);
    address.ipv4_.sin_addr.s_addr = static_cast<in_addr_t>(peer.low);
    return address;
  }
  /// The address for use with an IPv6 socket: IPv4 becomes ::ffff:a.b.c.d.
  [[nodiscard]] SocketAddress mapped_into_ipv6() const noexcept;
  [[nodiscard]] SocketAddress for_family(int family) const noexcept {
    return family == AF_INET ? *this : mapped_into_ipv6();
  }

  /// Whether both addresses are equal, ignoring their ports.
  [[nodiscard]] bool is_same_host(const SocketAddress& other) const noexcept {
    if (family() != other.family()) return false;
    if (is_ipv4()) return ipv4_.sin_addr.s_addr == other.ipv4_.sin_addr.s_addr;
    return IN6_ARE_ADDR_EQUAL(&ipv6_.sin6_addr, &other.ipv6_.sin6_addr) && zone() == other.zone();
  }
  friend bool operator==(const SocketAddress& a, const SocketAddress& b) noexcept {
    return a.is_same_host(b) && a.ipv4_.sin_port == b.ipv4_.sin_port;
  }

 private:
  [[nodiscard]] wire::PeerAddress ipv6_peer() const noexcept;
  [[nodiscard]] static SocketAddress of_ipv6_peer(const wire::PeerAddress& peer) noexcept;

  union {
    sockaddr_in ipv4_;  ///< Family and port are at the same offsets as in ipv6_.
    sockaddr_in6 ipv6_;
  };
};

/// How long a name server may take if no deadline is given.
inline constexpr Duration kResolvePatience = std::chrono::seconds{5};
/// The most addresses of one name that are used.
inline constexpr std::size_t kAddressCountMax = 8;

/// Resolves a numeric address or a host name to its addresses, in the order in which the system
/// would try them (RFC 6724); at least one. A separate thread asks the name server; the thread may
/// outlive `deadline`, and few run at a time.
/// @realtime set-up only
/// @errors   the name has no address; a link-local address lacks its zone; no answer by `deadline`
[[nodiscard]] expected<std::vector<SocketAddress>, SetupError> addresses_of(const std::string& host,
                                                                            std::uint16_t port,
                                                                            MonotonicTime deadline);
/// The first result of addresses_of(), within kResolvePatience.
[[nodiscard]] expected<SocketAddress, SetupError> address_of(const std::string& host,
                                                             std::uint16_t port);

/// An address of this host.
struct InterfaceAddress {
  std::string interface {};    ///< "eth0".
  SocketAddress address{};     ///< With port 0.
  int prefix_size = 0;         ///< Prefix length of its network, in bits.
  bool has_multicast = false;  ///< Its interface supports multicast and is not loopback.
};

/// The addresses of this host's active interfaces, in the system's order.
/// @realtime set-up only
[[nodiscard]] std::vector<InterfaceAddress> own_addresses();
/// Whether `address` is in the network of the interface address `own`.
[[nodiscard]] bool is_in_network_of(const InterfaceAddress& own,
                                    const SocketAddress& address) noexcept;

/// The addresses that a server listens on.
struct HostsToServe {
  bool is_any = false;                        ///< Every address, including later ones.
  std::vector<InterfaceAddress> addresses{};  ///< With `is_any`, the current ones.
};

/// The most addresses that a list may name.
inline constexpr std::size_t kServedAddressCountMax = 16;

/// Resolves `hosts`: a comma-separated list of IPv4 and IPv6 addresses, host names, interface
/// names, and "localhost", which means those of 127.0.0.1 and ::1 that this host has; or "any".
/// @errors   an unknown name or one without an address; no answer by `deadline`; too many addresses
[[nodiscard]] expected<HostsToServe, SetupError> hosts_to_serve(const std::string& hosts,
                                                                MonotonicTime deadline);

}  // namespace rtpm::transport
