#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/predicate/comparison.hpp"
#include "rtpm/predicate/operand.hpp"
#include "rtpm/predicate/value.hpp"

namespace rtpm::predicate {

/// A part of an expression.
struct Node {
  enum class Kind : std::uint8_t {
    kConstant,
    kProperty,
    kExists,
    kNot,
    kNegate,
    kAnd,
    kOr,
    kCompare,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kIn,
    kContained,  ///< The right text contains the left one.
  };
  Kind kind = Kind::kConstant;
  std::size_t offset = 0;  ///< Offset in the text.
  Comparison comparison = Comparison::kEqual;
  Value constant{};
  std::string property{};
  std::uint32_t left = 0;  ///< Operands, by their indexes; unary operators use the left one.
  std::uint32_t right = 0;
};

/// A parsed text: operands precede their operators; the last node is the whole expression.
using Nodes = std::vector<Node>;

/// The value of the whole expression; undefined if a property is missing or of another type, or
/// after a division by 0. `and` and `or` are defined if one side decides.
/// @realtime alloc-free
[[nodiscard]] Operand evaluate(const Nodes& nodes, const PropertySource& properties) noexcept;

}  // namespace rtpm::predicate
