#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/crypto/primitives.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::rpc {

/// Whether the transport is UDP or TCP, over which sessions with known servers are sealed.
[[nodiscard]] constexpr bool is_over_network(Transport transport) noexcept {
  return transport == Transport::kUdp || transport == Transport::kTcp;
}

/// An address to try, and its host in the URL.
struct ServerCandidate {
  std::string host;
  transport::SocketAddress address;
};

/// A server's address, and the transport to it.
struct ServerAddress {
  std::string host;
  std::uint16_t port = 0;
  Transport transport = Transport::kUdp;  ///< Never kAuto.
  std::string memory_folder{};            ///< The sockets' folder; empty for abstract names.
  /// Set only for a known server over UDP or TCP, whose sessions are always sealed.
  std::optional<crypto::PublicKey> key{};
  friend auto operator<=>(const ServerAddress&, const ServerAddress&) = default;
};

}  // namespace rtpm::rpc
