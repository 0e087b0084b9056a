#include <ifaddrs.h>

#include <bit>

#include "bsd_sockets.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::transport {
namespace {

int prefix_size_of(const sockaddr* mask, int family) noexcept {
  if (mask == nullptr) return 0;
  // Some systems do not set the family of a mask.
  if (family == AF_INET)
    return std::popcount(reinterpret_cast<const sockaddr_in*>(mask)->sin_addr.s_addr);
  int size = 0;
  for (const std::uint8_t byte : reinterpret_cast<const sockaddr_in6*>(mask)->sin6_addr.s6_addr)
    size += std::popcount(byte);
  return size;
}

}  // namespace

std::vector<InterfaceAddress> own_addresses() {
  std::vector<InterfaceAddress> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  for (const ifaddrs* each = list; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || (each->ifa_flags & IFF_UP) == 0) continue;
    const int family = each->ifa_addr->sa_family;
    if (family != AF_INET && family != AF_INET6) continue;
    const socklen_t size = family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
    const bool has_multicast =
        (each->ifa_flags & IFF_MULTICAST) != 0 && (each->ifa_flags & IFF_LOOPBACK) == 0;
    found.push_back({each->ifa_name, SocketAddress::of(each->ifa_addr, size),
                     prefix_size_of(each->ifa_netmask, family), has_multicast});
  }
  freeifaddrs(list);
  return found;
}

}  // namespace rtpm::transport
