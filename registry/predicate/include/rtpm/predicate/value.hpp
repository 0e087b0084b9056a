#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace rtpm::predicate {

/// Types of properties; wire numbers.
/// @source   ValueType in schema/idl/names.fbs
enum class Type : std::uint8_t {
  kBool,
  kInteger,
  kReal,
  kText,
  kBools,
  kIntegers,
  kReals,
  kTexts,
};
inline constexpr int kTypeCount = 8;

/// "bool", "integer", "real", "text", "bools", "integers", "reals", "texts".
[[nodiscard]] std::string_view to_string(Type type) noexcept;
[[nodiscard]] std::optional<Type> type_named(std::string_view name) noexcept;
[[nodiscard]] constexpr bool is_list(Type type) noexcept {
  return type >= Type::kBools;
}
[[nodiscard]] constexpr bool is_number(Type type) noexcept {
  return type == Type::kInteger || type == Type::kReal;
}
/// The type of a list's items.
[[nodiscard]] constexpr Type item_type(Type list) noexcept {
  return static_cast<Type>(static_cast<int>(list) - static_cast<int>(Type::kBools));
}
[[nodiscard]] constexpr Type list_of(Type item) noexcept {
  return static_cast<Type>(static_cast<int>(item) + static_cast<int>(Type::kBools));
}

using Item = std::variant<bool, std::int64_t, double, std::string>;

/// Values of one type.
struct List {
  Type item_type = Type::kText;
  std::vector<Item> items{};
  friend bool operator==(const List&, const List&) = default;
};

/// A property's value.
using Value = std::variant<bool, std::int64_t, double, std::string, List>;

[[nodiscard]] Type type_of(const Item& item) noexcept;
[[nodiscard]] Type type_of(const Value& value) noexcept;

/// The value in predicate syntax: 'haptic', 3, 2.5, true, ('x', 'y').
[[nodiscard]] std::string to_text(const Value& value);
/// Parses a constant; unquoted words are texts: true, 3, 2.5, arm, 'arm', ('x', 'y'). An empty list
/// is a list of texts.
[[nodiscard]] std::optional<Value> parse_value(std::string_view text);

/// A named value.
struct Property {
  std::string name{};
  Value value{};
  std::string unit{};  ///< The unit of a number: "newton"; empty if not stated.
  friend bool operator==(const Property&, const Property&) = default;
};

}  // namespace rtpm::predicate
