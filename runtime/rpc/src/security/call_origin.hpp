#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "rtpm/access/address_range.hpp"
#include "rtpm/access/subject.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::rpc {

/// A caller, and the address that it calls from.
struct CallOrigin {
  access::Subject subject{};
  /// nullopt if provably on this host; :: if unknown, which no range contains.
  std::optional<access::NetworkAddress> address{};
};

/// A peer's address, without its port; :: if it is unknown, see transport::host_of().
/// @realtime alloc-free
[[nodiscard]] inline access::NetworkAddress network_address(
    const wire::PeerAddress& peer) noexcept {
  access::NetworkAddress address{};
  if (peer.high == 0 && peer.low == 0) return address;
  std::ranges::copy(transport::SocketAddress::of(peer).mapped_into_ipv6().ipv6(), address.begin());
  return address;
}

/// A peer over a network: identified by its key in a sealed session, otherwise anonymous.
/// @param client  null if the session is not sealed
/// @realtime alloc-free
[[nodiscard]] inline CallOrigin origin_at(const crypto::PublicKey* client,
                                          const wire::PeerAddress& peer) noexcept {
  CallOrigin origin;
  origin.address = network_address(peer);
  if (client == nullptr) return origin;
  origin.subject.kind = access::Subject::Kind::kKey;
  origin.subject.key = *client;
  return origin;
}

/// A local user as the kernel reports it. An unknown user is anonymous, and its address is ::, so
/// that it does not count as a caller on this host.
/// @realtime alloc-free
[[nodiscard]] inline CallOrigin origin_of_user(std::optional<std::uint32_t> user) noexcept {
  CallOrigin origin;
  if (!user) {
    origin.address.emplace();
    return origin;
  }
  origin.subject.kind = access::Subject::Kind::kLocalUser;
  origin.subject.user = *user;
  return origin;
}

}  // namespace rtpm::rpc
