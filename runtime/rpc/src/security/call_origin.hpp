#pragma once

#include <algorithm>
#include <optional>

#include "rtpm/access/address_range.hpp"
#include "rtpm/access/subject.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::rpc {

/// Who calls, and from where.
struct CallOrigin {
  access::Subject subject{};
  std::optional<access::NetworkAddress> address{};  ///< Nothing: from this host, proved.
};

/// The address of a peer, without its port.
/// @realtime alloc-free
[[nodiscard]] inline access::NetworkAddress network_address(
    const wire::PeerAddress& peer) noexcept {
  access::NetworkAddress address{};
  const in6_addr native = transport::SocketAddress::of(peer).mapped_into_ipv6().ipv6();
  std::ranges::copy(native.s6_addr, address.begin());
  return address;
}

}  // namespace rtpm::rpc
