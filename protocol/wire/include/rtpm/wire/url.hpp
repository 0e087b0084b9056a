#pragma once

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

}  // namespace rtpm::wire
