#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace rtpm::predicate {

/// How two values are compared.
enum class Comparison : std::uint8_t {
  kEqual,
  kNotEqual,
  kLess,
  kLessOrEqual,
  kGreater,
  kGreaterOrEqual,
  kHasAnyBit,  ///< Integers: any bit of the right one is set in the left one.
};

/// The comparison that this text denotes; nullopt if none.
[[nodiscard]] std::optional<Comparison> comparison_of(std::string_view symbol) noexcept;
/// "==", "!=", "<", "<=", ">", ">=" or "&".
[[nodiscard]] std::string_view symbol_of(Comparison comparison) noexcept;

}  // namespace rtpm::predicate
