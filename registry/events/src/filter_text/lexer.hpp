#pragma once

#include <cstddef>
#include <string_view>

namespace rtpm::events {

/// A piece of a filter's text.
struct Token {
  enum class Kind : unsigned char {
    kEnd,
    kWord,     ///< A name or a keyword; may have dots.
    kNumber,   ///< Digits, with what follows without a space: "12", "-0x1f", "2.5e3", "5ms".
    kSymbol,   ///< One of ( ) , / : * & and the comparisons.
    kUnknown,  ///< A character of none of these.
  };
  Kind kind = Kind::kEnd;
  std::string_view text{};
  std::size_t offset = 0;
};

/// Cuts a filter's text into tokens.
/// @ownership refers to the text
class Lexer {
 public:
  explicit Lexer(std::string_view text) noexcept : text_(text) {}
  [[nodiscard]] Token next() noexcept;

 private:
  std::string_view text_;
  std::size_t offset_ = 0;
};

}  // namespace rtpm::events
