#include "rtpm/predicate/value.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <type_traits>
#include <utility>

#include "rtpm/predicate/lexer.hpp"
#include "rtpm/predicate/number.hpp"
#include "text.hpp"

namespace rtpm::predicate {
namespace {

constexpr std::array<std::string_view, kTypeCount> kTypeNames{
    "bool", "integer", "real", "text", "bools", "integers", "reals", "texts"};

std::string text_of(const Item& item) {
  if (const auto* truth = std::get_if<bool>(&item)) return *truth ? "true" : "false";
  if (const auto* integer = std::get_if<std::int64_t>(&item)) return std::to_string(*integer);
  if (const auto* text = std::get_if<std::string>(&item)) return quoted_text(*text);
  std::array<char, 40> digits{};  // The shortest text that reads as the same number.
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), std::get<double>(item)).ptr;
  std::string text(digits.data(), end);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

Value value_of(Item item) {
  return std::visit([](auto&& value) { return Value(std::forward<decltype(value)>(value)); },
                    std::move(item));
}

std::optional<Item> parse_item(std::string_view text) {
  if (text == "true") return Item(true);
  if (text == "false") return Item(false);
  if (const auto number = parse_number(text)) {
    if (const auto* integer = std::get_if<std::int64_t>(&*number)) return Item(*integer);
    if (const auto* real = std::get_if<double>(&*number)) return Item(*real);
    return std::nullopt;  // Larger than an integer.
  }
  if (text.starts_with('\'') || text.starts_with('"')) {
    Lexer lexer(text);
    const Token token = lexer.next();
    if (token.kind != Token::Kind::kText || token.text.size() != text.size()) return std::nullopt;
    return Item(unquoted_text(text));
  }
  return Item(std::string(text));
}

/// Parses ('x', 'y'), with items of one type; an integer among reals counts as real.
std::optional<Value> parse_list(std::string_view text) {
  List list;
  Lexer lexer(text.substr(1));
  Token token = lexer.next();
  bool is_closed = token.text == ")";
  while (!is_closed) {
    auto item = parse_item(token.text);
    if (token.text.empty() || !item) return std::nullopt;
    list.items.push_back(std::move(*item));
    token = lexer.next();
    is_closed = token.text == ")";
    if (!is_closed && token.text != ",") return std::nullopt;
    if (!is_closed) token = lexer.next();
  }
  if (lexer.next().kind != Token::Kind::kEnd) return std::nullopt;
  if (!list.items.empty()) list.item_type = type_of(list.items.front());
  const auto is_real = [](const Item& item) { return type_of(item) == Type::kReal; };
  if (std::ranges::any_of(list.items, is_real)) {
    list.item_type = Type::kReal;
    for (Item& item : list.items) {
      if (const auto* integer = std::get_if<std::int64_t>(&item)) {
        item = static_cast<double>(*integer);
      }
    }
  }
  const auto is_of_type = [&](const Item& item) { return type_of(item) == list.item_type; };
  if (!std::ranges::all_of(list.items, is_of_type)) return std::nullopt;
  return Value(std::move(list));
}

}  // namespace

std::string_view to_string(Type type) noexcept {
  const auto index = static_cast<std::size_t>(type);
  return index < kTypeNames.size() ? kTypeNames[index] : "unknown";
}

std::optional<Type> type_named(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kTypeNames, name);
  if (found == kTypeNames.end()) return std::nullopt;
  return static_cast<Type>(found - kTypeNames.begin());
}

Type type_of(const Item& item) noexcept {
  return static_cast<Type>(item.index());
}

Type type_of(const Value& value) noexcept {
  if (const auto* list = std::get_if<List>(&value)) return list_of(list->item_type);
  return static_cast<Type>(value.index());
}

std::string to_text(const Value& value) {
  return std::visit(
      [](const auto& held) -> std::string {
        if constexpr (std::is_same_v<std::decay_t<decltype(held)>, List>) {
          std::string text = "(";
          for (const Item& item : held.items)
            text += (text.size() > 1 ? ", " : "") + text_of(item);
          return text + ")";
        } else {
          return text_of(Item(held));
        }
      },
      value);
}

std::optional<Value> parse_value(std::string_view text) {
  if (text.starts_with('(')) return parse_list(text);
  auto item = parse_item(text);
  if (!item) return std::nullopt;
  return value_of(std::move(*item));
}

}  // namespace rtpm::predicate
