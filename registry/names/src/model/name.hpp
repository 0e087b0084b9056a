#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::names {

/// A name is 1 to 8 components, separated by '/', each of 1 to 64 letters, digits, '.', '_' or '-',
/// in total at most 200 bytes: "lab/arm0". A name is either bound or a directory of longer names.
inline constexpr std::size_t kComponentSizeMax = 64;
inline constexpr std::size_t kNameDepthMax = 8;
inline constexpr std::size_t kNameSizeMax = 200;
/// Fits "rtpm://", eight hosts of 41 bytes separated by ',', ":65535/" and a path of 200 bytes.
inline constexpr std::size_t kUrlSizeMax = 560;
inline constexpr std::size_t kInterfaceSizeMax = 128;

/// The index of the first component that is malformed or makes `name` exceed a limit; nullopt if
/// the name is well-formed.
/// @realtime alloc-free
[[nodiscard]] std::optional<std::uint8_t> first_bad_component(std::string_view name) noexcept;

/// Whether `url` has the form rtpm://host:port/path and at most kUrlSizeMax bytes.
[[nodiscard]] bool is_url(std::string_view url);

/// Whether `interface` is a qualified name: identifiers separated by '.'.
/// @realtime alloc-free
[[nodiscard]] bool is_interface(std::string_view interface) noexcept;

/// `text` in quotes, escaped.
[[nodiscard]] std::string quoted(std::string_view text);

/// The component of `name` at `index`; empty if there are fewer.
/// @realtime alloc-free
[[nodiscard]] std::string_view component_of(std::string_view name, std::size_t index) noexcept;

}  // namespace rtpm::names
