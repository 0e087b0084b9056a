#pragma once

#include <string>

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::rpc {

/// The callers that a server serves, and the proof of its own identity. The files are those of
/// rtpm::access; a name left empty means the file in access::key_folder().
///
/// A server of this host alone serves everybody on it, unless `authorized_file` is named. At any
/// other address it asks for grants, or `is_insecure` is set; otherwise it does not start.
struct ServerSecurity {
  std::string authorized_file{};  ///< The callers' grants; read anew when they change.
  std::string key_file{};         ///< The server's key; made at the first start.
  bool is_insecure = false;       ///< Serves callers without identity, at any address.
  std::string audit_file{};       ///< Sessions, refusals and administration; none if empty.
  std::string key_log_file{};     ///< Keys of sessions, for Wireshark; none if empty.
};

/// The callers that a server serves, as it turned out.
struct ServedCallers {
  std::string authorized_file{};    ///< The file of grants; without one, nobody is asked.
  crypto::PublicKey key{};            ///< Callers know it by this key, if it asks for grants.
  bool is_open_to_network = false;  ///< It asks nobody, and other hosts reach it.
};

/// The identity of a program to the servers that it calls, and the servers that it knows. A known
/// server is called over sealed sessions only.
struct NodeSecurity {
  std::string key_file{};            ///< Made by `rtpm key new`.
  std::string known_servers_file{};  ///< Filled by `rtpm key learn`.
  std::string key_log_file{};        ///< Keys of sessions, for Wireshark; none if empty.
};

}  // namespace rtpm::rpc
