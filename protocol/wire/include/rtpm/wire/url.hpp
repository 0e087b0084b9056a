#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::wire {

/// The parts of "rtpm://host:port/path".
/// @source   spec/hprotocol.md#hp-10
struct Url {
  std::string host;  ///< A numeric IPv4 address or a host name.
  std::uint16_t port = 0;
  std::string path;  ///< Without the leading slash.
};

/// Whether `text` claims to be an RTPM URL, well-formed or not.
[[nodiscard]] bool is_url(std::string_view text) noexcept;

/// The parts; nothing if the text is malformed.
/// @realtime set-up only
[[nodiscard]] std::optional<Url> parse_url(std::string_view text);

/// Whether `path` can be an object's: 1…200 bytes, components of [A-Za-z0-9._-], single slashes.
[[nodiscard]] bool is_valid_path(std::string_view path) noexcept;

/// How many similar paths a server suggests for an unknown one.
/// @source   spec/hprotocol.md#hp-6.1
inline constexpr std::size_t kSimilarPathCountMax = 4;

/// How many bytes two paths have in common at their beginnings and ends: a measure of how likely
/// one is a misspelling of the other.
/// @realtime alloc-free, linear in the shorter one
[[nodiscard]] std::size_t similarity(std::string_view path, std::string_view other) noexcept;

}  // namespace rtpm::wire
