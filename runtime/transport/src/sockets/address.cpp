#include "rtpm/transport/address.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <netdb.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/url.hpp"
#include "sockets/own_host.hpp"

namespace rtpm::transport {
namespace {

constexpr std::uint64_t kLinkLocalNetwork = 0xfe80'0000'0000'0000;
constexpr std::uint64_t kLinkLocalMask = 0xffc0'0000'0000'0000;
constexpr std::uint64_t kZoneMask = 0xffff'ffff;
constexpr std::uint32_t kPortMask = 0xffff;

// The network part, most significant byte first.
std::uint64_t network_at(const std::uint8_t* bytes) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof value; ++i)
    value = value << 8 | bytes[i];
  return value;
}

void put_network(std::uint64_t value, std::uint8_t* bytes) noexcept {
  for (std::size_t i = sizeof value; i-- > 0; value >>= 8)
    bytes[i] = static_cast<std::uint8_t>(value);
}

// The remaining bytes in little-endian order, so that ::1 is not mistaken for an IPv4 address,
// which has 32 bits and no network part.
std::uint64_t rest_at(const std::uint8_t* bytes) noexcept {
  return load_le<std::uint64_t>(reinterpret_cast<const std::byte*>(bytes));
}

}  // namespace

SocketAddress::SocketAddress(in_addr address, std::uint16_t port) noexcept : ipv6_{} {
  ipv4_.sin_family = AF_INET;
  ipv4_.sin_addr = address;
  set_port(port);
}

SocketAddress::SocketAddress(const in6_addr& address, std::uint32_t zone,
                             std::uint16_t port) noexcept
    : ipv6_{} {
  ipv6_.sin6_family = AF_INET6;
  ipv6_.sin6_addr = address;
  ipv6_.sin6_scope_id = zone;
  set_port(port);
}

SocketAddress SocketAddress::of(const sockaddr& address, socklen_t size) noexcept {
  SocketAddress copy;
  std::memcpy(&copy.ipv6_, &address, std::min(size, kSizeMax));
  return copy;
}

std::optional<SocketAddress> SocketAddress::parse(const std::string& host, std::uint16_t port) {
  in_addr ipv4{};
  if (inet_pton(AF_INET, host.c_str(), &ipv4) == 1) return SocketAddress(ipv4, port);
  const std::size_t percent = host.find('%');
  in6_addr ipv6{};
  if (inet_pton(AF_INET6, host.substr(0, percent).c_str(), &ipv6) != 1) return std::nullopt;
  std::uint32_t zone = 0;
  if (percent != std::string::npos) {
    zone = if_nametoindex(host.substr(percent + 1).c_str());
    if (zone == 0) return std::nullopt;
  }
  return SocketAddress(ipv6, zone, port);
}

bool SocketAddress::is_unspecified() const noexcept {
  return is_ipv4() ? ipv4_.sin_addr.s_addr == INADDR_ANY
                   : IN6_IS_ADDR_UNSPECIFIED(&ipv6_.sin6_addr);
}

bool SocketAddress::is_link_local() const noexcept {
  return !is_ipv4() && IN6_IS_ADDR_LINKLOCAL(&ipv6_.sin6_addr);
}

std::string SocketAddress::host() const {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* const bytes = is_ipv4() ? static_cast<const void*>(&ipv4_.sin_addr)
                                      : static_cast<const void*>(&ipv6_.sin6_addr);
  inet_ntop(family(), bytes, text.data(), text.size());
  std::string host(text.data());
  if (zone() == 0) return host;
  std::array<char, IF_NAMESIZE> name{};
  const bool has_name = if_indextoname(zone(), name.data()) != nullptr;
  return host + "%" + (has_name ? std::string(name.data()) : std::to_string(zone()));
}

std::string SocketAddress::text() const {
  return wire::host_and_port(host(), port());
}

wire::PeerAddress SocketAddress::ipv6_peer() const noexcept {
  const std::uint8_t* const bytes = ipv6_.sin6_addr.s6_addr;
  if (IN6_IS_ADDR_V4MAPPED(&ipv6_.sin6_addr)) {
    std::uint32_t mapped = 0;
    std::memcpy(&mapped, bytes + 12, sizeof mapped);
    return {0, mapped, ipv6_.sin6_port};
  }
  std::uint64_t network = network_at(bytes);
  // The rest of a link-local network is 0, and the address is ambiguous without its link.
  if (network == kLinkLocalNetwork) network |= ipv6_.sin6_scope_id;
  return {network, rest_at(bytes + 8), ipv6_.sin6_port};
}

SocketAddress SocketAddress::of_ipv6_peer(const wire::PeerAddress& peer) noexcept {
  if (peer.high == kOwnHostNetwork) return of({0, peer.low, peer.port});
  const auto port = ntohs(static_cast<in_port_t>(peer.port & kPortMask));
  const bool is_link_local = (peer.high & kLinkLocalMask) == kLinkLocalNetwork;
  const std::uint64_t zone = is_link_local ? peer.high & kZoneMask : 0;
  in6_addr address{};
  put_network(peer.high ^ zone, address.s6_addr);
  store_le(reinterpret_cast<std::byte*>(address.s6_addr + 8), peer.low);
  return {address, static_cast<std::uint32_t>(zone), port};
}

SocketAddress SocketAddress::mapped_into_ipv6() const noexcept {
  if (!is_ipv4()) return *this;
  in6_addr mapped{};
  mapped.s6_addr[10] = mapped.s6_addr[11] = 0xff;
  std::memcpy(mapped.s6_addr + 12, &ipv4_.sin_addr, sizeof ipv4_.sin_addr);
  return {mapped, 0, port()};
}

}  // namespace rtpm::transport
