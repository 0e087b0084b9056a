#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::discovery {

/// The default scope.
inline constexpr std::string_view kThisHost = "host";
/// A registry's default port; then its object's path.
inline constexpr std::uint16_t kRegistryPort = 7420;
inline constexpr std::string_view kNamesPath = "rtpm/names";
/// Maximum number of hosts in a list.
inline constexpr std::size_t kListedHostCountMax = 32;

/// A host of a unicast list.
struct ListedHost {
  std::string host{};
  /// Port of its name service; if 0, the ports that its servers report, or 7420.
  std::uint16_t port = 0;
};

/// The places to search for name services.
struct Scope {
  enum class Kind : std::uint8_t {
    kUrl,    ///< Only this registry.
    kHost,   ///< This host.
    kLan,    ///< This host, and hosts that answer in a domain of the LAN, by multicast.
    kHosts,  ///< This host and the listed ones.
  };
  Kind kind = Kind::kHost;
  std::string url{};
  std::uint8_t domain = 0;
  std::string interface {};  ///< Name or address of the interface, or "any".
  std::vector<ListedHost> hosts{};

  [[nodiscard]] bool is_url() const noexcept { return kind == Kind::kUrl; }
  [[nodiscard]] bool is_of_lan() const noexcept {
    return kind == Kind::kLan || kind == Kind::kHosts;
  }
};

/// Parses "rtpm://host:port/path", "host", "lan[:DOMAIN]@INTERFACE" or "HOST[:PORT],HOST[:PORT]…".
/// @realtime set-up only
/// @errors   the text has none of these forms; the error lists them
[[nodiscard]] expected<Scope, SetupError> parse_scope(std::string_view text);

}  // namespace rtpm::discovery
