#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <variant>

namespace rtpm::predicate {

/// A number in a text, in the narrowest of these types that holds it.
using Number = std::variant<std::int64_t, std::uint64_t, double>;

/// Parses decimal digits, or hexadecimal ones after "0x"; nullopt if the text is not such a number,
/// or too large.
[[nodiscard]] std::optional<std::uint64_t> parse_natural(std::string_view text) noexcept;
/// Parses any finite number; nullopt if the text is not one.
[[nodiscard]] std::optional<Number> parse_number(std::string_view text) noexcept;

}  // namespace rtpm::predicate
