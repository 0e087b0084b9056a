#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::wire {

/// The parts of "rtpm://host:port/path".   Source: spec/hprotocol.md#hp-10.
struct Url {
  std::string host;  ///< Numeric IPv4 or a host name.
  std::uint16_t port = 0;
  std::string path;  ///< Without the leading slash.
};

/// Whether `text` claims to be an RTPM URL, well-formed or not.
[[nodiscard]] bool is_url(std::string_view text) noexcept;

/// The parts, or nothing if the text is malformed.   Set-up only.
[[nodiscard]] std::optional<Url> parse_url(std::string_view text);

/// True for an object's path: 1…200 bytes, components of [A-Za-z0-9._-] parted by single slashes.
[[nodiscard]] bool is_valid_path(std::string_view path) noexcept;

/// How many paths a server tells that has not the one it was asked for.
/// Source: spec/hprotocol.md#hp-6.1.
inline constexpr std::size_t kSimilarPathCountMax = 4;

/// How many bytes two paths have in common at their beginnings and at their ends: the more, the
/// more likely is one a slip of the other. RT: alloc-free; as long as the shorter one.
[[nodiscard]] std::size_t similarity(std::string_view path, std::string_view other) noexcept;

}  // namespace rtpm::wire
