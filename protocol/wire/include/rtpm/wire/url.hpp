#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::wire {

/// How many hosts a URL may name.
inline constexpr std::size_t kUrlHostCountMax = 8;

/// The parts of "rtpm://host:port/path". Several hosts, "rtpm://a,b:port/path", mean the same
/// server: a client tries them in order.
/// @source   spec/hprotocol.md#hp-10
struct Url {
  /// Numeric IPv4 and IPv6 addresses and host names. IPv6 addresses have no brackets, and their
  /// zone follows '%': "fe80::1%eth0".
  std::vector<std::string> hosts{};
  std::uint16_t port = 0;
  std::string path;  ///< Without the leading slash.

  /// The hosts and the port: "127.0.0.1:4711", "[::1],10.0.0.7:4711".
  [[nodiscard]] std::string authority() const;
  /// The whole URL.
  [[nodiscard]] std::string text() const;
};

/// A host as written in a URL: "10.0.0.7", "[::1]", "[fe80::1%25eth0]".
/// @realtime set-up only
[[nodiscard]] std::string host_in_url(std::string_view host);
/// A host as written in a URL, with its port: "10.0.0.7:4711", "[::1]:4711".
/// @realtime set-up only
[[nodiscard]] std::string host_and_port(std::string_view host, std::uint16_t port);

/// Whether `text` is a numeric IPv6 address (RFC 4291, 2.2), without brackets and zone.
[[nodiscard]] bool is_ipv6_address(std::string_view text) noexcept;

/// Whether `text` claims to be an RTPM URL, well-formed or not.
[[nodiscard]] bool is_url(std::string_view text) noexcept;

/// Parses a URL; nullopt if the text is malformed.
/// @realtime set-up only
[[nodiscard]] std::optional<Url> parse_url(std::string_view text);

/// Whether `path` is a valid object path: 1…200 bytes, components of [A-Za-z0-9._-], single
/// slashes.
[[nodiscard]] bool is_valid_path(std::string_view path) noexcept;

/// The maximum number of similar paths that a server suggests for an unknown path.
/// @source   spec/hprotocol.md#hp-6.1
inline constexpr std::size_t kSimilarPathCountMax = 4;

/// How many bytes two paths have in common at their beginnings and ends: a measure of how likely
/// one is a misspelling of the other.
/// @realtime alloc-free, linear in the shorter one
[[nodiscard]] std::size_t similarity(std::string_view path, std::string_view other) noexcept;

}  // namespace rtpm::wire
