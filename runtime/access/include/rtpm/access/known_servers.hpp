#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/access/authorized.hpp"

namespace rtpm::access {

/// A server whose key the client has pinned.
struct KnownServer {
  std::string host{};  ///< The host in its URL: a name or a numeric address, IPv6 without brackets.
  std::uint16_t port = 0;  ///< 0 for all ports of that host.
  crypto::PublicKey key{};
  std::size_t line = 0;  ///< The line number in its file, from 1.
  friend bool operator==(const KnownServer&, const KnownServer&) = default;
};

/// The contents of a file of known servers.
struct KnownServers {
  std::vector<KnownServer> servers{};
  /// Local users whose servers are trusted to share memory, besides this user and root.
  std::vector<std::uint32_t> local_users{};
  std::vector<LineFault> faults{};
  std::size_t fault_count = 0;  ///< Includes faults beyond kFaultCountMax.

  /// The keys of this server, those for the port before those for the host; a server may
  /// temporarily have two. Empty if the server is unknown. Do not call an unknown server without
  /// sealing, unless `servers` is empty.
  [[nodiscard]] std::vector<KnownServer> find(std::string_view host, std::uint16_t port) const;
};

/// Parses known servers, one per line; a line that begins with `#` is a comment:
///
///     robot-cell rtpm25519 BASE64
///     192.168.7.4:7420 rtpm25519 BASE64
///     [fd00::4]:7420 rtpm25519 BASE64
///     local uid:1001
///
/// A faulty line is ignored; the other lines stay in force.
/// @realtime set-up only
[[nodiscard]] KnownServers parse_known_servers(std::string_view text);

/// The line that parse_known_servers() reads as `server`.
[[nodiscard]] std::string to_line(const KnownServer& server);

}  // namespace rtpm::access
