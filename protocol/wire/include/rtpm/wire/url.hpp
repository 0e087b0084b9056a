#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::wire {

/// The number of hosts that a URL may name.
inline constexpr std::size_t kUrlHostCountMax = 8;

/// The parts of "rtpm://host:port/path". Several hosts are one server's, "rtpm://a,b:port/path": a
/// client tries them in their order.
/// @source   spec/hprotocol.md#hp-10
struct Url {
  /// Numeric IPv4 and IPv6 addresses and host names, an IPv6 address without brackets and its zone
  /// after '%': "fe80::1%eth0".
  std::vector<std::string> hosts{};
  std::uint16_t port = 0;
  std::string path;  ///< Without the leading slash.

  /// "127.0.0.1:4711", "[::1],10.0.0.7:4711".
  [[nodiscard]] std::string authority() const;
  /// The whole URL.
  [[nodiscard]] std::string text() const;
};

/// A host in the form of a URL: "10.0.0.7", "[::1]", "[fe80::1%25eth0]".
/// @realtime set-up only
[[nodiscard]] std::string host_in_url(std::string_view host);
/// A host in the form of a URL, with its port: "10.0.0.7:4711", "[::1]:4711".
/// @realtime set-up only
[[nodiscard]] std::string host_and_port(std::string_view host, std::uint16_t port);

/// Whether `text` is a numeric IPv6 address (RFC 4291, 2.2), without brackets and zone.
[[nodiscard]] bool is_ipv6_address(std::string_view text) noexcept;

/// Whether `text` claims to be an RTPM URL, well-formed or not.
[[nodiscard]] bool is_url(std::string_view text) noexcept;

/// The parts; nothing if the text is malformed.
/// @realtime set-up only
[[nodiscard]] std::optional<Url> parse_url(std::string_view text);

/// Whether `path` can be an object's: 1…200 bytes, components of [A-Za-z0-9._-], single slashes.
[[nodiscard]] bool is_valid_path(std::string_view path) noexcept;

/// The similar paths that a server suggests for an unknown one, at most.
/// @source   spec/hprotocol.md#hp-6.1
inline constexpr std::size_t kSimilarPathCountMax = 4;

/// The bytes that two paths have in common at their beginnings and ends: a measure of how likely
/// one is a misspelling of the other.
/// @realtime alloc-free, linear in the shorter one
[[nodiscard]] std::size_t similarity(std::string_view path, std::string_view other) noexcept;

}  // namespace rtpm::wire
