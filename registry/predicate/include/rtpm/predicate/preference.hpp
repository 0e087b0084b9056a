#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/predicate/predicate.hpp"

namespace rtpm::predicate {

/// How to order the candidates that a predicate accepts: "min EXPRESSION", "max EXPRESSION", "with
/// PREDICATE", "random", "first".
class Preference {
 public:
  /// Parses a text; an empty one is "first".
  /// @realtime set-up only
  /// @errors   no such preference; those of Expression::parse(), with offsets into `text`; min or
  ///           max of an expression that is neither number nor text; `with` of one that is not a
  ///           bool
  [[nodiscard]] static expected<Preference, TextError> parse(
      std::string_view text, const TypeOfProperty& type_of_property = {});

  /// The indexes of the candidates in order of preference. Candidates with equal values keep their
  /// order; those with an undefined value come last.
  /// @param random  provides the order for "random"
  [[nodiscard]] std::vector<std::size_t> order(const std::vector<const PropertySource*>& candidates,
                                               std::uint64_t random) const;
  /// Whether the preference is "first", so that the first candidates found are the preferred ones.
  [[nodiscard]] bool is_first() const noexcept { return kind_ == Kind::kFirst; }

 private:
  enum class Kind : std::uint8_t { kFirst, kMin, kMax, kWith, kRandom };
  Preference(Kind kind, std::optional<Expression> expression) noexcept
      : kind_(kind), expression_(std::move(expression)) {}

  Kind kind_;
  std::optional<Expression> expression_;
};

}  // namespace rtpm::predicate
