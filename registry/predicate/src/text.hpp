#pragma once

#include <string>
#include <string_view>

namespace rtpm::predicate {

/// `text` in single quotes; single quotes and backslashes are escaped by a backslash.
[[nodiscard]] inline std::string quoted_text(std::string_view text) {
  std::string quoted = "'";
  for (const char byte : text) {
    if (byte == '\'' || byte == '\\') quoted += '\\';
    quoted += byte;
  }
  return quoted + "'";
}

/// The text of a kText token.
[[nodiscard]] inline std::string unquoted_text(std::string_view token) {
  std::string text;
  for (std::size_t i = 1; i + 1 < token.size(); ++i) {
    if (token[i] == '\\') ++i;
    text += token[i];
  }
  return text;
}

}  // namespace rtpm::predicate
