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
  kHasAnyBit,  ///< Integers: the left one has any bit of the right one set.
};

/// The comparison with this symbol; nullopt if none.
[[nodiscard]] std::optional<Comparison> comparison_of(std::string_view symbol) noexcept;
/// "==", "!=", "<", "<=", ">", ">=" or "&".
[[nodiscard]] std::string_view symbol_of(Comparison comparison) noexcept;

}  // namespace rtpm::predicate
