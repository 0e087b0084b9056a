#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/events/defaults.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::console {

/// The options of rtpm-console.
struct Configuration {
  std::string address = "127.0.0.1";
  std::uint16_t port = 8765;
  bool is_insecure_lan = false;  ///< Allows an address that other hosts can reach.
  std::string registry{};
  rpc::NodeSecurity security{};
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  std::string page{};                    ///< The page's folder; if empty, the installed one.
  std::string recordings{};              ///< The folder of recordings; empty if there is none.
  /// The file of incidents; empty: they end with this program.
  std::string incidents{};
  bool is_read_only = false;
  std::string token{};        ///< If empty, a random token, or the one in `token_file`.
  std::string token_file{};   ///< The file that keeps the token; empty if there is none.
  bool prints_token = false;  ///< Prints the token even if standard output is not a terminal.
  std::vector<std::string> host_names{};  ///< Names by which browsers may reach this server.
  double seconds = 0;                     ///< 0 to run until a stop signal.
};

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

/// Whether only programs on this host can reach `address`.
[[nodiscard]] bool is_loopback(const std::string& address);

}  // namespace rtpm::console
