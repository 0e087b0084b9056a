#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

enum class TokenKind : std::uint8_t { kIdentifier, kNumber, kString, kPunctuation, kEnd };

/// @ownership `text` views the source file's text
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string_view text{};  ///< Strings include their quotes.
  std::size_t offset = 0;

  [[nodiscard]] bool is(std::string_view what) const noexcept { return text == what; }
  [[nodiscard]] bool is_identifier() const noexcept { return kind == TokenKind::kIdentifier; }
  [[nodiscard]] std::size_t end() const noexcept { return offset + text.size(); }
  [[nodiscard]] Span span() const noexcept { return {offset, text.size()}; }
  /// The text; strings without their quotes.
  [[nodiscard]] std::string_view value() const noexcept;
};

/// The tokens of a schema, without comments; the last one has kind kEnd. Unknown characters become
/// punctuation, which FlatBuffers' parser rejects.
/// @ownership the result views `source`
[[nodiscard]] std::vector<Token> tokenize(const SourceFile& source);

}  // namespace rtpm::schema
