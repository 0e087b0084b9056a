#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::names {

/// A name is 1 to 8 components with '/' between, each of 1 to 64 letters, digits, '.', '_' or '-',
/// in all at most 200 bytes: "lab/arm0". A name is bound or a directory of longer names, never
/// both.
inline constexpr std::size_t kComponentSizeMax = 64;
inline constexpr std::size_t kNameDepthMax = 8;
inline constexpr std::size_t kNameSizeMax = 200;
/// "rtpm://", eight hosts of 41 bytes with ',' between, ":65535/" and a path of 200 bytes fit.
inline constexpr std::size_t kUrlSizeMax = 560;
inline constexpr std::size_t kInterfaceSizeMax = 128;

/// The first component, counted from 0, that makes `name` malformed or carries it beyond a limit;
/// nothing if the name is well-formed.
/// @realtime alloc-free
[[nodiscard]] std::optional<std::uint8_t> first_bad_component(std::string_view name) noexcept;

/// Whether `url` has the form rtpm://host:port/path and at most kUrlSizeMax bytes.
[[nodiscard]] bool is_url(std::string_view url);

/// Whether `interface` is a qualified name, identifiers with '.' between.
/// @realtime alloc-free
[[nodiscard]] bool is_interface(std::string_view interface) noexcept;

/// `text` in quotes, escaped.
[[nodiscard]] std::string quoted(std::string_view text);

/// The component of `name` with the number `index`, empty if there are fewer.
/// @realtime alloc-free
[[nodiscard]] std::string_view component_of(std::string_view name, std::size_t index) noexcept;

}  // namespace rtpm::names
