#include <algorithm>
#include <cmath>
#include <compare>
#include <cstdint>
#include <limits>
#include <optional>

#include "expression.hpp"
#include "operand_order.hpp"

namespace rtpm::predicate {
namespace {

using Kind = Node::Kind;

/// A three-valued truth; nullopt means undefined.
using Truth = std::optional<bool>;

Truth truth_of(const Operand& operand) noexcept {
  const bool* const truth = std::get_if<bool>(&operand);
  return truth == nullptr ? std::nullopt : Truth(*truth);
}
Operand operand_of(Truth truth) noexcept {
  return truth ? Operand(*truth) : Operand();
}

std::optional<double> real_of(const Operand& operand) noexcept {
  if (const auto* integer = std::get_if<std::int64_t>(&operand)) {
    return static_cast<double>(*integer);
  }
  const auto* const real = std::get_if<double>(&operand);
  return real == nullptr ? std::nullopt : std::optional(*real);
}

// Exact, although double cannot hold every integer.
std::partial_ordering order(std::int64_t integer, double real) noexcept {
  if (std::isnan(real)) return std::partial_ordering::unordered;
  if (real >= 0x1p63) return std::partial_ordering::less;
  if (real < -0x1p63) return std::partial_ordering::greater;
  const double whole = std::trunc(real);
  const auto as_integer = static_cast<std::int64_t>(whole);
  if (integer != as_integer) return integer <=> as_integer;
  return whole <=> real;
}

std::partial_ordering reversed(std::partial_ordering ordering) noexcept {
  return 0 <=> ordering;
}

Truth compare(Comparison comparison, const Operand& left, const Operand& right) noexcept {
  if (comparison == Comparison::kHasAnyBit) {
    const auto* const bits = std::get_if<std::int64_t>(&left);
    const auto* const mask = std::get_if<std::int64_t>(&right);
    if (bits == nullptr || mask == nullptr) return std::nullopt;
    return (*bits & *mask) != 0;
  }
  const std::partial_ordering ordering = order_of(left, right);
  if (ordering == std::partial_ordering::unordered) return std::nullopt;
  switch (comparison) {
    case Comparison::kEqual:
      return ordering == 0;
    case Comparison::kNotEqual:
      return ordering != 0;
    case Comparison::kLess:
      return ordering < 0;
    case Comparison::kLessOrEqual:
      return ordering <= 0;
    case Comparison::kGreater:
      return ordering > 0;
    default:
      return ordering >= 0;
  }
}

constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t kGreatest = std::numeric_limits<std::int64_t>::max();

bool has_sum(std::int64_t left, std::int64_t right) noexcept {
  return right >= 0 ? left <= kGreatest - right : left >= kLeast - right;
}
bool has_difference(std::int64_t left, std::int64_t right) noexcept {
  return right >= 0 ? left >= kLeast + right : left <= kGreatest + right;
}
bool has_product(std::int64_t left, std::int64_t right) noexcept {
  if (left == 0 || right == 0) return true;
  if (right == -1) return left != kLeast;  // A quotient below would overflow.
  if (left > 0 && right > 0) return left <= kGreatest / right;
  if (left > 0) return right >= kLeast / left;
  return left >= (right > 0 ? kLeast : kGreatest) / right;
}

// Calculates with integers; nullopt on overflow, and for a division.
std::optional<std::int64_t> calculate(Kind kind, std::int64_t left, std::int64_t right) noexcept {
  if (kind == Kind::kAdd && has_sum(left, right)) return left + right;
  if (kind == Kind::kSubtract && has_difference(left, right)) return left - right;
  if (kind == Kind::kMultiply && has_product(left, right)) return left * right;
  return std::nullopt;
}

double calculate(Kind kind, double left, double right) noexcept {
  switch (kind) {
    case Kind::kAdd:
      return left + right;
    case Kind::kSubtract:
      return left - right;
    case Kind::kMultiply:
      return left * right;
    default:
      return left / right;
  }
}

Operand calculate(Kind kind, const Operand& left, const Operand& right) noexcept {
  const auto* const left_integer = std::get_if<std::int64_t>(&left);
  const auto* const right_integer = std::get_if<std::int64_t>(&right);
  if (left_integer != nullptr && right_integer != nullptr) {
    if (const auto result = calculate(kind, *left_integer, *right_integer)) return *result;
  }
  const auto left_real = real_of(left);
  const auto right_real = real_of(right);
  if (!left_real || !right_real) return {};
  const double result = calculate(kind, *left_real, *right_real);
  return std::isfinite(result) ? Operand(result) : Operand();
}

Operand operand_of(const Item& item) noexcept {
  if (const auto* text = std::get_if<std::string>(&item)) return std::string_view(*text);
  if (const auto* integer = std::get_if<std::int64_t>(&item)) return *integer;
  if (const auto* real = std::get_if<double>(&item)) return *real;
  return std::get<bool>(item);
}

Truth is_in(const Operand& item, const Operand& list) noexcept {
  const auto* const items = std::get_if<const List*>(&list);
  if (items == nullptr || std::holds_alternative<std::monostate>(item)) return std::nullopt;
  return std::ranges::any_of(
      (*items)->items, [&](const Item& each) { return order_of(item, operand_of(each)) == 0; });
}

Truth is_contained(const Operand& part, const Operand& whole) noexcept {
  const auto* const part_text = std::get_if<std::string_view>(&part);
  const auto* const whole_text = std::get_if<std::string_view>(&whole);
  if (part_text == nullptr || whole_text == nullptr) return std::nullopt;
  return whole_text->find(*part_text) != std::string_view::npos;
}

/// Evaluates a node with its operands; the parser has bounded the depth.
class Evaluator {
 public:
  Evaluator(const Nodes& nodes, const PropertySource& properties) noexcept
      : nodes_(nodes), properties_(properties) {}

  [[nodiscard]] Operand value(std::uint32_t number) const noexcept {
    const Node& node = nodes_[number];
    switch (node.kind) {
      case Kind::kConstant:
        return predicate::operand_of(node.constant);
      case Kind::kProperty:
        return properties_.find(node.property);
      case Kind::kExists:
        return !std::holds_alternative<std::monostate>(properties_.find(node.property));
      case Kind::kNot: {
        const Truth truth = truth_of(value(node.left));
        return truth ? Operand(!*truth) : Operand();
      }
      case Kind::kNegate:
        return calculate(Kind::kSubtract, std::int64_t{0}, value(node.left));
      case Kind::kAnd:
        return decided(node, false);
      case Kind::kOr:
        return decided(node, true);
      case Kind::kCompare:
        return operand_of(compare(node.comparison, value(node.left), value(node.right)));
      case Kind::kIn:
        return operand_of(is_in(value(node.left), value(node.right)));
      case Kind::kContained:
        return operand_of(is_contained(value(node.left), value(node.right)));
      default:
        return calculate(node.kind, value(node.left), value(node.right));
    }
  }

 private:
  // `and` and `or`: a side that equals `decisive` decides alone.
  [[nodiscard]] Operand decided(const Node& node, bool decisive) const noexcept {
    const Truth left = truth_of(value(node.left));
    if (left == decisive) return decisive;
    const Truth right = truth_of(value(node.right));
    if (right == decisive) return decisive;
    return left && right ? Operand(!decisive) : Operand();
  }

  const Nodes& nodes_;
  const PropertySource& properties_;
};

}  // namespace

std::partial_ordering order_of(const Operand& left, const Operand& right) noexcept {
  const auto* const left_integer = std::get_if<std::int64_t>(&left);
  const auto* const right_integer = std::get_if<std::int64_t>(&right);
  const auto* const left_real = std::get_if<double>(&left);
  const auto* const right_real = std::get_if<double>(&right);
  if (left_integer != nullptr && right_integer != nullptr) return *left_integer <=> *right_integer;
  if (left_real != nullptr && right_real != nullptr) return *left_real <=> *right_real;
  if (left_integer != nullptr && right_real != nullptr) return order(*left_integer, *right_real);
  if (left_real != nullptr && right_integer != nullptr) {
    return reversed(order(*right_integer, *left_real));
  }
  const auto* const left_text = std::get_if<std::string_view>(&left);
  const auto* const right_text = std::get_if<std::string_view>(&right);
  if (left_text != nullptr && right_text != nullptr) return *left_text <=> *right_text;
  const auto* const left_truth = std::get_if<bool>(&left);
  const auto* const right_truth = std::get_if<bool>(&right);
  if (left_truth != nullptr && right_truth != nullptr) return *left_truth <=> *right_truth;
  return std::partial_ordering::unordered;
}

Operand operand_of(const Value& value) noexcept {
  if (const auto* list = std::get_if<List>(&value)) return list;
  if (const auto* text = std::get_if<std::string>(&value)) return std::string_view(*text);
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return *integer;
  if (const auto* real = std::get_if<double>(&value)) return *real;
  return std::get<bool>(value);
}

Operand evaluate(const Nodes& nodes, const PropertySource& properties) noexcept {
  if (nodes.empty()) return true;
  return Evaluator(nodes, properties).value(static_cast<std::uint32_t>(nodes.size() - 1));
}

}  // namespace rtpm::predicate
