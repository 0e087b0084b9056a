#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace rtpm::predicate {

/// A piece of a predicate's or filter's text.
struct Token {
  enum class Kind : unsigned char {
    kEnd,
    kWord,  ///< A name or a keyword; may have dots.
    /// A digit, then letters, digits, '_', '.' and the sign of an exponent: "12", "0x1f", "2.5e-3",
    /// "5ms"; with Minus::kSign also a '-' before it.
    kNumber,
    kText,     ///< A text in single or double quotes, which are included.
    kSymbol,   ///< A comparison, or one of ( ) , / : * & + - ~.
    kUnknown,  ///< Any other character.
  };
  Kind kind = Kind::kEnd;
  std::string_view text{};
  std::size_t offset = 0;
};

/// The meaning of a '-' before a digit.
enum class Minus : std::uint8_t {
  kSign,    ///< A sign: "-1" is one token.
  kSymbol,  ///< Arithmetic: "-1" is two tokens.
};

/// Splits a text into tokens.
/// @ownership refers to the text
class Lexer {
 public:
  explicit Lexer(std::string_view text, Minus minus = Minus::kSign) noexcept
      : text_(text), minus_(minus) {}
  [[nodiscard]] Token next() noexcept;

 private:
  std::string_view text_;
  Minus minus_;
  std::size_t offset_ = 0;
};

}  // namespace rtpm::predicate
