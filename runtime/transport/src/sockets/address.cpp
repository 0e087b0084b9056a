#include "rtpm/transport/address.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include "os/native_socket.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/url.hpp"
#include "sockets/native.hpp"
#include "sockets/own_host.hpp"

namespace rtpm::transport {
namespace {

constexpr std::uint64_t kLinkLocalNetwork = 0xfe80'0000'0000'0000;
constexpr std::uint64_t kLinkLocalMask = 0xffc0'0000'0000'0000;
constexpr std::uint64_t kZoneMask = 0xffff'ffff;
constexpr std::uint32_t kPortMask = 0xffff;
// ::ffff:0:0/96 holds IPv4 addresses (RFC 4291, 2.5.5.2).
constexpr std::array<std::uint8_t, 12> kMappedPrefix{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

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

static_assert(sizeof(SocketAddress) == sizeof(sockaddr_in6) &&
                  SocketAddress::kSizeMax == sizeof(sockaddr_in6) && AF_UNSPEC == 0 &&
                  AF_INET == 2 && offsetof(sockaddr_in, sin_family) == 0 &&
                  offsetof(sockaddr_in, sin_port) == 2 && offsetof(sockaddr_in, sin_addr) == 4 &&
                  offsetof(sockaddr_in6, sin6_port) == 2 &&
                  offsetof(sockaddr_in6, sin6_addr) == 8 &&
                  offsetof(sockaddr_in6, sin6_scope_id) == 24,
              "a SocketAddress has the layout of the system's addresses");

SocketAddress SocketAddress::of_ipv6(const Ipv6& address, std::uint32_t zone,
                                     std::uint16_t port) noexcept {
  SocketAddress made;
  made.family_ = AF_INET6;
  made.ipv6_ = address;
  made.zone_ = zone;
  made.set_port(port);
  return made;
}

SocketAddress SocketAddress::of(const void* native, std::size_t size) noexcept {
  SocketAddress copy;
  std::memcpy(copy.native(), native, std::min(size, kSizeMax));
  return copy;
}

std::optional<SocketAddress> SocketAddress::parse(const std::string& host, std::uint16_t port) {
  in_addr ipv4{};
  if (inet_pton(AF_INET, host.c_str(), &ipv4) == 1) return of_ipv4(ntohl(ipv4.s_addr), port);
  const std::size_t percent = host.find('%');
  Ipv6 ipv6{};
  if (inet_pton(AF_INET6, host.substr(0, percent).c_str(), &ipv6) != 1) return std::nullopt;
  std::uint32_t zone = 0;
  if (percent != std::string::npos) {
    zone = os::zone_of(host.substr(percent + 1));
    if (zone == 0) return std::nullopt;
  }
  return of_ipv6(ipv6, zone, port);
}

bool SocketAddress::is_unspecified() const noexcept {
  return is_ipv4() ? ipv4_ == 0 : ipv6_ == Ipv6{};
}

bool SocketAddress::is_link_local() const noexcept {
  return !is_ipv4() && ipv6_[0] == 0xfe && (ipv6_[1] & 0xc0) == 0x80;
}

std::string SocketAddress::host() const {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* const bytes =
      is_ipv4() ? static_cast<const void*>(&ipv4_) : static_cast<const void*>(ipv6_.data());
  inet_ntop(family(), bytes, text.data(), text.size());
  std::string host(text.data());
  if (zone() == 0) return host;
  return host + "%" + os::name_of_zone(zone());
}

std::string SocketAddress::text() const {
  return wire::host_and_port(host(), port());
}

wire::PeerAddress SocketAddress::ipv6_peer() const noexcept {
  if (std::equal(kMappedPrefix.begin(), kMappedPrefix.end(), ipv6_.begin())) {
    std::uint32_t mapped = 0;
    std::memcpy(&mapped, ipv6_.data() + kMappedPrefix.size(), sizeof mapped);
    return {0, mapped, port_};
  }
  std::uint64_t network = network_at(ipv6_.data());
  // The rest of a link-local network is 0, and the address is ambiguous without its link.
  if (network == kLinkLocalNetwork) network |= zone_;
  return {network, rest_at(ipv6_.data() + 8), port_};
}

SocketAddress SocketAddress::of_ipv6_peer(const wire::PeerAddress& peer) noexcept {
  if (peer.high == kOwnHostNetwork) return of({0, peer.low, peer.port});
  const bool is_link_local = (peer.high & kLinkLocalMask) == kLinkLocalNetwork;
  const std::uint64_t zone = is_link_local ? peer.high & kZoneMask : 0;
  Ipv6 bytes{};
  put_network(peer.high ^ zone, bytes.data());
  store_le(reinterpret_cast<std::byte*>(bytes.data() + 8), peer.low);
  SocketAddress address = of_ipv6(bytes, static_cast<std::uint32_t>(zone), 0);
  address.port_ = static_cast<std::uint16_t>(peer.port & kPortMask);
  return address;
}

SocketAddress SocketAddress::mapped_into_ipv6() const noexcept {
  if (!is_ipv4()) return *this;
  Ipv6 mapped{};
  std::ranges::copy(kMappedPrefix, mapped.begin());
  std::memcpy(mapped.data() + kMappedPrefix.size(), &ipv4_, sizeof ipv4_);
  return of_ipv6(mapped, 0, port());
}

}  // namespace rtpm::transport
