#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/predicate/operand.hpp"
#include "rtpm/predicate/text_error.hpp"
#include "rtpm/predicate/value.hpp"

namespace rtpm::predicate {

inline constexpr std::size_t kPredicateSizeMax = 4096;  ///< Maximum size of a text, in bytes.
inline constexpr std::size_t kPredicateNodeCountMax = 256;
inline constexpr std::size_t kListSizeMax = 64;  ///< Items of a list in a predicate.

/// Returns a property's type by its name; nullopt if unknown, or if it differs between names.
using TypeOfProperty = std::function<std::optional<Type>(std::string_view name)>;

/// A parsed expression over properties.
/// @ownership a value; copies share the parsed text
/// @threads  any, concurrently
class Expression {
 public:
  /// Parses a text; an empty one is true. Grammar: registry/predicate/README.md.
  /// @realtime set-up only
  /// @errors   malformed; a limit; an operand whose type its operator does not accept, as far as
  ///           `type_of_property` knows the types
  [[nodiscard]] static expected<Expression, TextError> parse(
      std::string_view text, const TypeOfProperty& type_of_property);

  /// The value; undefined if a property is missing or of another type, or after a division by 0.
  /// @realtime alloc-free
  [[nodiscard]] Operand value(const PropertySource& properties) const noexcept;
  /// The type; nullopt if it depends on properties of unknown type.
  [[nodiscard]] std::optional<Type> type() const noexcept;

  /// A property that the text names.
  struct Mention {
    std::string name;
    std::size_t offset = 0;
  };
  [[nodiscard]] std::vector<Mention> mentions() const;

 private:
  struct Parsed;
  explicit Expression(std::shared_ptr<const Parsed> parsed) noexcept;
  std::shared_ptr<const Parsed> parsed_;
};

/// An expression whose value is true or false.
class Predicate {
 public:
  /// @errors   those of Expression::parse(); the expression is not a bool
  [[nodiscard]] static expected<Predicate, TextError> parse(
      std::string_view text, const TypeOfProperty& type_of_property = {});
  /// Whether it is true. An undefined result is not true, and `not` leaves it undefined.
  /// @realtime alloc-free
  [[nodiscard]] bool accepts(const PropertySource& properties) const noexcept;
  [[nodiscard]] const Expression& expression() const noexcept { return expression_; }

 private:
  explicit Predicate(Expression expression) noexcept : expression_(std::move(expression)) {}
  Expression expression_;
};

}  // namespace rtpm::predicate
