#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"

namespace rtpm::laboratory {

/// In a file, both from 1.
struct Position {
  std::uint32_t line = 1;
  std::uint32_t column = 1;
};

/// Something wrong in a file, there.
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
  std::string text{};  ///< Of kOther: its kind, "a date".
  std::int64_t integer = 0;
  bool boolean = false;
  std::vector<Value> items{};  ///< Of a list or a table; a table's are sorted by key.
  std::string key{};           ///< In its table.
  Position key_position{};

  /// The table's value of that key; nullptr: it has none.
  [[nodiscard]] const Value* find(std::string_view wanted) const;
  /// "a text", "a list", for messages.
  [[nodiscard]] std::string kind_text() const;
};

/// Reads TOML.
/// @realtime set-up only
[[nodiscard]] expected<Value, Mistake> parse_document(std::string_view text);

}  // namespace rtpm::laboratory
