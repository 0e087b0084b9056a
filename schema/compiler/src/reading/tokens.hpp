#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

enum class TokenKind : std::uint8_t { kIdentifier, kNumber, kString, kPunctuation, kEnd };

/// A word of a schema. `text` views the source file's text.
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string_view text{};  ///< A string with its quotes.
  std::size_t offset = 0;

  [[nodiscard]] bool is(std::string_view what) const noexcept { return text == what; }
  [[nodiscard]] bool is_identifier() const noexcept { return kind == TokenKind::kIdentifier; }
  [[nodiscard]] std::size_t end() const noexcept { return offset + text.size(); }
  [[nodiscard]] Span span() const noexcept { return {offset, text.size()}; }
  /// A string without its quotes, any other token as it is.
  [[nodiscard]] std::string_view value() const noexcept;
};

/// The words of a schema without its comments, the last one of kind kEnd. It takes any text: what
/// no schema has becomes punctuation, because FlatBuffers' parser is the judge of that. Ownership:
/// the result views `source`.
[[nodiscard]] std::vector<Token> tokenize(const SourceFile& source);

}  // namespace rtpm::schema
