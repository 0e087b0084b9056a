#include "rtpm/predicate/predicate.hpp"

#include <utility>

#include "checker.hpp"
#include "expression.hpp"
#include "expression_parser.hpp"

namespace rtpm::predicate {

struct Expression::Parsed {
  Nodes nodes;
  std::optional<Type> type{};
};

Expression::Expression(std::shared_ptr<const Parsed> parsed) noexcept
    : parsed_(std::move(parsed)) {}

expected<Expression, TextError> Expression::parse(std::string_view text,
                                                  const TypeOfProperty& type_of_property) {
  auto nodes = parse_expression(text);
  if (!nodes) return unexpected{std::move(nodes.error())};
  const auto type = check_types(*nodes, type_of_property);
  if (!type) return unexpected{type.error()};
  return Expression(std::make_shared<const Parsed>(Parsed{std::move(*nodes), *type}));
}

Operand Expression::value(const PropertySource& properties) const noexcept {
  return evaluate(parsed_->nodes, properties);
}

std::optional<Type> Expression::type() const noexcept {
  return parsed_->type;
}

std::vector<Expression::Mention> Expression::mentions() const {
  std::vector<Mention> mentions;
  for (const Node& node : parsed_->nodes) {
    const bool is_one = node.kind == Node::Kind::kProperty || node.kind == Node::Kind::kExists;
    if (is_one) mentions.push_back({node.property, node.offset});
  }
  return mentions;
}

expected<Predicate, TextError> Predicate::parse(std::string_view text,
                                                const TypeOfProperty& type_of_property) {
  auto expression = Expression::parse(text, type_of_property);
  if (!expression) return unexpected{std::move(expression.error())};
  const auto type = expression->type();
  if (type && *type != Type::kBool) {
    return unexpected{TextError{
        0, "it is of " + std::string(to_string(*type)) + ", not of bool: nothing is compared"}};
  }
  return Predicate(std::move(*expression));
}

bool Predicate::accepts(const PropertySource& properties) const noexcept {
  const Operand value = expression_.value(properties);
  const bool* const truth = std::get_if<bool>(&value);
  return truth != nullptr && *truth;
}

}  // namespace rtpm::predicate
