#pragma once

#include <string>

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::rpc {

/// The callers that a server accepts, and the proof of its own identity. rtpm::access defines the
/// files; an empty name means the default file in access::key_folder().
///
/// A server that only this host reaches accepts every local caller unless `authorized_file` is set.
/// At any other address it requires grants or `is_insecure`; otherwise it does not start.
struct ServerSecurity {
  std::string authorized_file{};  ///< The callers' grants; reloaded when the file changes.
  std::string key_file{};         ///< The server's key; created at the first start.
  bool is_insecure = false;       ///< Accepts callers without identity, at any address.
  std::string audit_file{};       ///< Logs sessions, refusals and administration; no log if empty.
  std::string key_log_file{};     ///< Session keys for Wireshark; no file if empty.
};

/// The callers that a running server accepts.
struct ServedCallers {
  std::string authorized_file{};  ///< The file of grants; if empty, callers are not authenticated.
  crypto::PublicKey key{};  ///< The key by which callers know the server, if it authenticates them.
  /// Other hosts reach the server, and it does not authenticate callers.
  bool is_open_to_network = false;
};

/// A program's identity towards servers, and the servers that it knows. Known servers are called
/// over sealed sessions only.
struct NodeSecurity {
  std::string key_file{};            ///< Created by `rtpm key new`.
  std::string known_servers_file{};  ///< Filled by `rtpm key learn`.
  std::string key_log_file{};        ///< Session keys for Wireshark; no file if empty.
};

}  // namespace rtpm::rpc
