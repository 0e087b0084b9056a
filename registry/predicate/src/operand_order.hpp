#pragma once

#include <compare>

#include "rtpm/predicate/operand.hpp"

namespace rtpm::predicate {

/// Orders numbers, texts or truth values; unordered if the types differ or a value is undefined.
/// Exact between integers and reals.
/// @realtime alloc-free
[[nodiscard]] std::partial_ordering order_of(const Operand& left, const Operand& right) noexcept;

/// Whether it is a number or a text.
[[nodiscard]] inline bool is_ordered(const Operand& operand) noexcept {
  return std::holds_alternative<std::int64_t>(operand) || std::holds_alternative<double>(operand) ||
         std::holds_alternative<std::string_view>(operand);
}

}  // namespace rtpm::predicate
