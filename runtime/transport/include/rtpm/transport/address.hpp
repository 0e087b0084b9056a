#pragma once

#include <array>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
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
  using Ipv6 = std::array<std::uint8_t, 16>;

  /// Creates an address without a family.
  SocketAddress() noexcept = default;
  /// @param address  127.0.0.1 is 0x7f000001
  [[nodiscard]] static SocketAddress of_ipv4(std::uint32_t address, std::uint16_t port) noexcept {
    SocketAddress made;
    made.family_ = kIpv4Family;
    made.ipv4_ = swapped(address);
    made.set_port(port);
    return made;
  }
  /// @param zone  the interface index of a link-local address, otherwise 0
  [[nodiscard]] static SocketAddress of_ipv6(const Ipv6& address, std::uint32_t zone,
                                             std::uint16_t port) noexcept;
  /// Parses a numeric address, "127.0.0.1", "::1", "fe80::1%eth0"; nullopt if `host` is not
  /// numeric.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<SocketAddress> parse(const std::string& host,
                                                          std::uint16_t port);
  /// Copies a sockaddr of the system, at most kSizeMax bytes.
  [[nodiscard]] static SocketAddress of(const void* native, std::size_t size) noexcept;

  /// The address as the system's sockaddr_in or sockaddr_in6; memory for either, up to kSizeMax.
  [[nodiscard]] const void* native() const noexcept { return this; }
  [[nodiscard]] void* native() noexcept { return this; }
  static constexpr std::size_t kSizeMax = 28;
  /// The bytes of native() that belong to this address.
  [[nodiscard]] std::size_t size() const noexcept {
    constexpr std::size_t kIpv4Size = 16;
    return is_ipv4() ? kIpv4Size : kSizeMax;
  }
  /// The system's number of its family: AF_INET, AF_INET6, or AF_UNSPEC, which is 0.
  [[nodiscard]] int family() const noexcept { return family_; }
  [[nodiscard]] bool is_ipv4() const noexcept { return family_ == kIpv4Family; }
  [[nodiscard]] std::uint16_t port() const noexcept { return swapped(port_); }
  void set_port(std::uint16_t port) noexcept { port_ = swapped(port); }
  /// 127.0.0.1 is 0x7f000001.
  [[nodiscard]] std::uint32_t ipv4() const noexcept { return swapped(ipv4_); }
  [[nodiscard]] const Ipv6& ipv6() const noexcept { return ipv6_; }
  /// The 4 or 16 bytes of the address, the most significant first.
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
    if (!is_ipv4()) return ipv6_;
    return {reinterpret_cast<const std::uint8_t*>(&ipv4_), sizeof ipv4_};
  }
  /// The interface index, for a link-local IPv6 address.
  [[nodiscard]] std::uint32_t zone() const noexcept { return is_ipv4() ? 0 : zone_; }

  /// Whether it is in 127.0.0.0/8 or ::1.
  [[nodiscard]] bool is_loopback() const noexcept {
    constexpr std::uint32_t kLoopbackNet = 127;
    if (is_ipv4()) return ipv4() >> 24 == kLoopbackNet;
    constexpr Ipv6 kLoopback{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
    return ipv6_ == kLoopback;
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
    return {0, ipv4_, port_};
  }
  /// The reverse of peer().
  [[nodiscard]] static SocketAddress of(const wire::PeerAddress& peer) noexcept {
    if (peer.high != 0 || peer.low >> 32 != 0) return of_ipv6_peer(peer);
    SocketAddress address;
    address.family_ = kIpv4Family;
    address.port_ = static_cast<std::uint16_t>(peer.port);
    address.ipv4_ = static_cast<std::uint32_t>(peer.low);
    return address;
  }
  /// The address for use with an IPv6 socket: IPv4 becomes ::ffff:a.b.c.d.
  [[nodiscard]] SocketAddress mapped_into_ipv6() const noexcept;
  [[nodiscard]] SocketAddress for_family(int family) const noexcept {
    return family == kIpv4Family ? *this : mapped_into_ipv6();
  }

  /// Whether both addresses are equal, ignoring their ports.
  [[nodiscard]] bool is_same_host(const SocketAddress& other) const noexcept {
    if (family_ != other.family_) return false;
    if (is_ipv4()) return ipv4_ == other.ipv4_;
    return ipv6_ == other.ipv6_ && zone_ == other.zone_;
  }
  friend bool operator==(const SocketAddress& a, const SocketAddress& b) noexcept {
    return a.is_same_host(b) && a.port_ == b.port_;
  }

 private:
  /// AF_INET of every system.
  static constexpr std::uint16_t kIpv4Family = 2;

  /// Between this host's byte order and the network's.
  template <class T>
  [[nodiscard]] static constexpr T swapped(T value) noexcept {
    if constexpr (std::endian::native == std::endian::big) return value;
    T turned = 0;
    for (std::size_t i = 0; i < sizeof value; ++i)
      turned = static_cast<T>(turned << 8 | (value >> 8 * i & 0xffU));
    return turned;
  }
  [[nodiscard]] wire::PeerAddress ipv6_peer() const noexcept;
  [[nodiscard]] static SocketAddress of_ipv6_peer(const wire::PeerAddress& peer) noexcept;

  // The layout of sockaddr_in and sockaddr_in6, which differ from ipv4_ on. Port and address are in
  // the network's byte order.
  std::uint16_t family_ = 0;
  std::uint16_t port_ = 0;
  std::uint32_t ipv4_ = 0;  ///< sin6_flowinfo of an IPv6 address.
  Ipv6 ipv6_{};
  std::uint32_t zone_ = 0;
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
