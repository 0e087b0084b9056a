#pragma once

#include <string>

#include "rtpm/seal/primitives.hpp"

namespace rtpm::rpc {

/// Whom a server serves, and how it proves who it is. The files are those of rtpm::access; a name
/// left empty means the file in access::key_folder().
///
/// A server of this host alone serves everybody on it, unless `authorized_file` is named. At any
/// other address it asks for grants, or `is_insecure` is set; else it does not start.
struct ServerSecurity {
  std::string authorized_file{};  ///< Who may do what; read anew when it changes.
  std::string key_file{};         ///< The server's key; made at the first start.
  bool is_insecure = false;       ///< Asks nobody who he is, whatever the address.
  std::string audit_file{};       ///< Sessions, refusals and administration; empty: none.
  std::string key_log_file{};     ///< Keys of sessions, for Wireshark; empty: none.
};

/// Whom a server serves, as it turned out.
struct ServedCallers {
  std::string authorized_file{};    ///< Whose grants it asks; empty: it asks nobody.
  seal::PublicKey key{};            ///< By which callers know it, if it asks for grants.
  bool is_open_to_network = false;  ///< It asks nobody, and other hosts reach it.
};

/// Who a program is to the servers that it calls, and which of them it knows. A server that is
/// known is called over sealed sessions only.
struct NodeSecurity {
  std::string key_file{};            ///< Made by `rtpm key new`.
  std::string known_servers_file{};  ///< Filled by `rtpm key learn`.
  std::string key_log_file{};        ///< Keys of sessions, for Wireshark; empty: none.
};

}  // namespace rtpm::rpc
