#include "rtpm/predicate/preference.hpp"

#include <algorithm>
#include <numeric>
#include <random>
#include <string>
#include <utility>

#include "operand_order.hpp"
#include "rtpm/predicate/lexer.hpp"
#include "rtpm/predicate/token_reader.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::predicate {
namespace {

bool is_true(const Operand& operand) noexcept {
  const bool* const truth = std::get_if<bool>(&operand);
  return truth != nullptr && *truth;
}

}  // namespace

expected<Preference, TextError> Preference::parse(std::string_view text,
                                                  const TypeOfProperty& type_of_property) {
  Lexer lexer(text);
  const Token word = lexer.next();
  const std::size_t begin = word.offset + word.text.size();
  const std::string_view rest = text.substr(std::min(begin, text.size()));
  const bool has_rest = lexer.next().kind != Token::Kind::kEnd;
  if (word.kind == Token::Kind::kEnd) return Preference(Kind::kFirst, std::nullopt);
  const bool is_first = word.text == "first";
  if (is_first || word.text == "random") {
    if (has_rest) {
      return unexpected{TextError{begin, "nothing follows '" + std::string(word.text) + "'"}};
    }
    return Preference(is_first ? Kind::kFirst : Kind::kRandom, std::nullopt);
  }
  const bool is_with = word.text == "with";
  if (!is_with && word.text != "min" && word.text != "max") {
    return unexpected{
        TextError{word.offset, "expected min, max, with, random or first" +
                                   program::suggestion(std::string(word.text),
                                                       {"min", "max", "with", "random", "first"})}};
  }
  if (!has_rest) {
    return unexpected{TextError{text.size(), "expected an expression behind '" +
                                                 std::string(word.text) + "', not the end"}};
  }
  auto expression = Expression::parse(rest, type_of_property);
  if (!expression) {
    return unexpected{TextError{begin + expression.error().offset, expression.error().what}};
  }
  const auto type = expression->type();
  const bool is_fit =
      !type || (is_with ? *type == Type::kBool : *type == Type::kText || is_number(*type));
  if (!is_fit) {
    return unexpected{TextError{begin + rest.find_first_not_of(" \t\r\n"),
                                "it is of " + std::string(to_string(*type)) + ", but '" +
                                    std::string(word.text) + "' takes " +
                                    (is_with ? "bool" : "numbers or text")}};
  }
  const Kind kind = is_with ? Kind::kWith : word.text == "min" ? Kind::kMin : Kind::kMax;
  return Preference(kind, std::move(*expression));
}

std::vector<std::size_t> Preference::order(const std::vector<const PropertySource*>& candidates,
                                           std::uint64_t random) const {
  std::vector<std::size_t> numbers(candidates.size());
  std::iota(numbers.begin(), numbers.end(), std::size_t{0});
  if (kind_ == Kind::kFirst) return numbers;
  if (kind_ == Kind::kRandom) {
    std::ranges::shuffle(numbers, std::mt19937_64(random));
    return numbers;
  }
  std::vector<Operand> values;
  values.reserve(candidates.size());
  for (const PropertySource* candidate : candidates)
    values.push_back(expression_->value(*candidate));
  const auto is_defined = [&](std::size_t number) {
    return kind_ == Kind::kWith ? is_true(values[number]) : is_ordered(values[number]);
  };
  // Clang 14 rejects libstdc++'s std::ranges::stable_partition.
  const auto undefined = std::stable_partition(numbers.begin(), numbers.end(), is_defined);
  if (kind_ == Kind::kWith) return numbers;
  std::stable_sort(numbers.begin(), undefined, [&](std::size_t a, std::size_t b) {
    // Numbers come before texts, if candidates have different types.
    const bool is_text_a = std::holds_alternative<std::string_view>(values[a]);
    const bool is_text_b = std::holds_alternative<std::string_view>(values[b]);
    if (is_text_a != is_text_b) return is_text_b;
    const std::partial_ordering ordering = order_of(values[a], values[b]);
    return kind_ == Kind::kMin ? ordering < 0 : ordering > 0;
  });
  return numbers;
}

}  // namespace rtpm::predicate
