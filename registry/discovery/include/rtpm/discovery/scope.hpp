#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::discovery {

/// The default scope.
inline constexpr std::string_view kThisHost = "host";
/// Where a registry listens by default; its object there.
inline constexpr std::uint16_t kRegistryPort = 7420;
inline constexpr std::string_view kNamesPath = "rtpm/names";
/// How many hosts a list has at most.
inline constexpr std::size_t kListedHostCountMax = 32;

/// A host of a unicast list.
struct ListedHost {
  std::string host{};
  std::uint16_t port = 0;  ///< Of its name service; 0: those that its servers say, or 7420.
};

/// Where name services are looked for.
struct Scope {
  enum class Kind : std::uint8_t {
    kUrl,    ///< One registry and nothing else.
    kHost,   ///< This host.
    kLan,    ///< And those that answer in a domain of the LAN, by multicast.
    kHosts,  ///< This host and listed ones.
  };
  Kind kind = Kind::kHost;
  std::string url{};
  std::uint8_t domain = 0;
  std::string interface {};  ///< Its name or address, or "any".
  std::vector<ListedHost> hosts{};

  [[nodiscard]] bool is_url() const noexcept { return kind == Kind::kUrl; }
  [[nodiscard]] bool is_of_lan() const noexcept {
    return kind == Kind::kLan || kind == Kind::kHosts;
  }
};

/// Of "rtpm://host:port/path", "host", "lan[:DOMAIN]@INTERFACE" or "HOST[:PORT],HOST[:PORT]…".
/// @realtime set-up only
/// @errors   none of these; the text lists them
[[nodiscard]] expected<Scope, SetupError> parse_scope(std::string_view text);

}  // namespace rtpm::discovery
