#pragma once

#include <cstdint>

#include "rtpm/transport/address.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

/// hp-4-7: all callers on this host count as one host, whatever their addresses. As the protocol
/// counts an IPv6 /64 as one host, they get an unused one, 0:0:0:1::/64 in the reserved ::/8.
/// SocketAddress::of() returns the original address.
inline constexpr std::uint64_t kOwnHostNetwork = 1;

/// The peer, as counted, for a call to the address `called`. IPv6 addresses except ::1 stay in
/// their /64.
/// @realtime alloc-free
[[nodiscard]] inline wire::PeerAddress counted(wire::PeerAddress peer,
                                               const SocketAddress& called) noexcept {
  const auto address = SocketAddress::of(peer);
  const bool is_own = address.is_loopback() || address.is_same_host(called);
  if (is_own && peer.high == 0) peer.high = kOwnHostNetwork;
  return peer;
}

}  // namespace rtpm::transport
