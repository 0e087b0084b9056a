#include "expression_parser.hpp"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "rtpm/predicate/number.hpp"
#include "rtpm/predicate/predicate.hpp"
#include "rtpm/predicate/token_reader.hpp"
#include "text.hpp"

namespace rtpm::predicate {
namespace {

using Kind = Node::Kind;
/// The index of a node.
using Index = std::uint32_t;

/// Recursive descent; each function appends its nodes and returns the index of the last one.
class ExpressionParser : TokenReader {
 public:
  explicit ExpressionParser(std::string_view text) : TokenReader(text, Minus::kSymbol) {}

  expected<Nodes, TextError> parse() {
    if (text().size() > kPredicateSizeMax) {
      return unexpected{
          TextError{kPredicateSizeMax,
                    "a predicate has at most " + std::to_string(kPredicateSizeMax) + " bytes"}};
    }
    if (token_.kind == Token::Kind::kEnd) return Nodes{};
    static_cast<void>(parse_any());
    if (!error_ && token_.kind != Token::Kind::kEnd) {
      fail(token_,
           is_at("=") ? "write '=='" : "expected an operator or the end, not " + shown(token_));
    }
    if (error_) return unexpected{std::move(*error_)};
    return std::move(nodes_);
  }

 private:
  Index made(Node node) {
    if (nodes_.size() >= kPredicateNodeCountMax) {
      fail({Token::Kind::kUnknown, {}, node.offset},
           "a predicate has at most " + std::to_string(kPredicateNodeCountMax) + " parts");
      return 0;
    }
    nodes_.push_back(std::move(node));
    return static_cast<Index>(nodes_.size() - 1);
  }
  Index made(Kind kind, const Token& at, Index left, Index right = 0) {
    return made({.kind = kind, .offset = at.offset, .left = left, .right = right});
  }

  // ---- operators, from weak to strong ------------------------------------------------------

  Index parse_any() {
    Index left = parse_all();
    for (Token at = token_; take_operator("or", "||"); at = token_)
      left = made(Kind::kOr, at, left, parse_all());
    return left;
  }

  Index parse_all() {
    Index left = parse_not();
    for (Token at = token_; take_operator("and", "&&"); at = token_)
      left = made(Kind::kAnd, at, left, parse_not());
    return left;
  }

  Index parse_not() {
    const Token at = token_;
    if (!take_not()) return parse_relation();
    return made(Kind::kNot, at, nested(at, [this] { return parse_not(); }));
  }

  Index parse_relation() {
    const Index left = parse_sum();
    const Token at = token_;
    if (take("~")) return made(Kind::kContained, at, left, parse_sum());
    if (take("in")) return made(Kind::kIn, at, left, parse_list());
    if (at.kind != Token::Kind::kSymbol) return left;
    const auto comparison = comparison_of(at.text);
    if (!comparison) return left;
    advance();
    const Index right = parse_sum();
    return made({.kind = Kind::kCompare,
                 .offset = at.offset,
                 .comparison = *comparison,
                 .left = left,
                 .right = right});
  }

  Index parse_sum() {
    Index left = parse_product();
    for (Token at = token_; is_at("+") || is_at("-"); at = token_) {
      advance();
      left = made(at.text == "+" ? Kind::kAdd : Kind::kSubtract, at, left, parse_product());
    }
    return left;
  }

  Index parse_product() {
    Index left = parse_factor();
    for (Token at = token_; is_at("*") || is_at("/"); at = token_) {
      advance();
      left = made(at.text == "*" ? Kind::kMultiply : Kind::kDivide, at, left, parse_factor());
    }
    return left;
  }

  Index parse_factor() {
    const Token at = token_;
    if (take("-")) return made(Kind::kNegate, at, nested(at, [this] { return parse_factor(); }));
    if (take("(")) {
      const Index inner = nested(at, [this] { return parse_any(); });
      require(")");
      return inner;
    }
    if (at.kind == Token::Kind::kWord) return parse_word(at);
    return made({.offset = at.offset, .constant = parse_constant()});
  }

  Index parse_word(const Token& at) {
    if (is_truth(at)) return made({.offset = at.offset, .constant = parse_constant()});
    advance();
    if (at.text != "exists" && at.text != "exist") {
      return made({.kind = Kind::kProperty, .offset = at.offset, .property = std::string(at.text)});
    }
    const Token name = token_;
    if (name.kind != Token::Kind::kWord) {
      fail(name, "expected a property, not " + shown(name));
      return 0;
    }
    advance();
    return made({.kind = Kind::kExists, .offset = at.offset, .property = std::string(name.text)});
  }

  // ---- constants ---------------------------------------------------------------------------

  static bool is_truth(const Token& token) {
    return token.text == "true" || token.text == "false" || token.text == "TRUE" ||
           token.text == "FALSE";
  }

  Value parse_constant() {
    const Token at = token_;
    advance();
    if (at.kind == Token::Kind::kText) return unquoted_text(at.text);
    if (at.kind == Token::Kind::kWord && is_truth(at)) {
      return at.text == "true" || at.text == "TRUE";
    }
    if (at.kind == Token::Kind::kNumber) {
      const auto number = parse_number(at.text);
      if (number && std::holds_alternative<std::int64_t>(*number)) {
        return std::get<std::int64_t>(*number);
      }
      if (number && std::holds_alternative<double>(*number)) return std::get<double>(*number);
      fail(at, number ? shown(at) + " exceeds an integer" : shown(at) + " is no number");
      return {};
    }
    const bool is_quote = at.text == "'" || at.text == "\"";
    fail(at, is_quote ? "the text has no closing quote"
                      : "expected a property, a number or a 'text', not " + shown(at));
    return {};
  }

  /// PROPERTY · (1, 2) · ('a', 'b')
  Index parse_list() {
    const Token at = token_;
    if (!take("(")) return parse_sum();
    List list;
    do {
      const Token item_at = token_;
      const bool is_negative = take("-");
      auto item = item_of(parse_constant(), is_negative);
      if (!error_ && !item) fail(item_at, "only numbers are negative");
      if (error_) return 0;
      add(list, std::move(*item), item_at);
    } while (take(","));
    require(")");
    return made({.offset = at.offset, .constant = std::move(list)});
  }

  static std::optional<Item> item_of(Value value, bool is_negative) {
    if (const auto* integer = std::get_if<std::int64_t>(&value)) {
      return Item(is_negative ? -*integer : *integer);
    }
    if (const auto* real = std::get_if<double>(&value)) return Item(is_negative ? -*real : *real);
    if (is_negative) return std::nullopt;
    if (auto* text = std::get_if<std::string>(&value)) return Item(std::move(*text));
    return Item(std::get<bool>(value));
  }

  void add(List& list, Item item, const Token& at) {
    const Type type = type_of(item);
    if (list.items.empty()) list.item_type = type;
    if (is_number(type) && is_number(list.item_type)) {
      list.item_type = std::max(type, list.item_type);
    } else if (type != list.item_type) {
      fail(at, "a list has items of one type, and this one is of " +
                   std::string(to_string(list.item_type)));
    }
    if (list.items.size() >= kListSizeMax) {
      fail(at, "a list has at most " + std::to_string(kListSizeMax) + " items");
    }
    list.items.push_back(std::move(item));
  }

  Nodes nodes_{};
};

}  // namespace

expected<Nodes, TextError> parse_expression(std::string_view text) {
  return ExpressionParser(text).parse();
}

}  // namespace rtpm::predicate
