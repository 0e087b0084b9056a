#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"

namespace rtpm::laboratory {

/// A position in a file; both count from 1.
struct Position {
  std::uint32_t line = 1;
  std::uint32_t column = 1;
};

/// A mistake and its position in a file.
struct Mistake {
  Position position{};
  std::string what{};
  std::string remedy{};
};

/// A value of a TOML document.
struct Value {
  enum class Kind : std::uint8_t { kText, kInteger, kBool, kList, kTable, kOther };

  Kind kind = Kind::kOther;
  Position position{};
  std::string text{};  ///< The text, or the kind of a kOther: "a date".
  std::int64_t integer = 0;
  bool boolean = false;
  std::vector<Value> items{};  ///< The items of a list or a table; a table's are sorted by key.
  std::string key{};           ///< Its key in its table.
  Position key_position{};

  /// The table's value for that key; nullptr if there is none.
  [[nodiscard]] const Value* find(std::string_view wanted) const;
  /// The kind for messages: "a text", "a list".
  [[nodiscard]] std::string kind_text() const;
};

/// Reads TOML.
/// @realtime set-up only
[[nodiscard]] expected<Value, Mistake> parse_document(std::string_view text);

}  // namespace rtpm::laboratory
