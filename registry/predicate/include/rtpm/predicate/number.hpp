#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <variant>

namespace rtpm::predicate {

/// A number as text has it: the narrowest of these that holds it.
using Number = std::variant<std::int64_t, std::uint64_t, double>;

/// Digits, or hexadecimal ones behind "0x"; nullopt: the text is no such number, or a larger one.
[[nodiscard]] std::optional<std::uint64_t> parse_natural(std::string_view text) noexcept;
/// Any finite number; nullopt: the text is none.
[[nodiscard]] std::optional<Number> parse_number(std::string_view text) noexcept;

}  // namespace rtpm::predicate
