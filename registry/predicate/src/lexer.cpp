#include "rtpm/predicate/lexer.hpp"

#include <algorithm>
#include <array>

namespace rtpm::predicate {
namespace {

constexpr std::array<std::string_view, 7> kTwoCharacterSymbols{
    "==", "!=", "<=", ">=", "&&", "||", "<>"};
constexpr std::string_view kPunctuation = "(),/:*&<>=!+-~";

bool is_digit(char byte) noexcept {
  return byte >= '0' && byte <= '9';
}
bool is_letter(char byte) noexcept {
  return (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z') || byte == '_';
}
bool is_in_word(char byte) noexcept {
  return is_letter(byte) || is_digit(byte) || byte == '.';
}

std::size_t word_size(std::string_view rest) noexcept {
  return static_cast<std::size_t>(std::ranges::find_if_not(rest, is_in_word) - rest.begin());
}

// The size of a number, including its sign if it has one.
std::size_t number_size(std::string_view rest) noexcept {
  const bool is_hex = rest.substr(rest.front() == '-' ? 1 : 0).starts_with("0x");
  std::size_t size = rest.front() == '-' ? 1 : 0;
  for (; size < rest.size(); ++size) {
    const bool is_exponent_sign = !is_hex && (rest[size] == '+' || rest[size] == '-') &&
                                  (rest[size - 1] == 'e' || rest[size - 1] == 'E');
    if (!is_in_word(rest[size]) && !is_exponent_sign) break;
  }
  return size;
}

// The size of a quoted text, including both quotes; 0 if the closing one is missing. A backslash
// escapes the next character.
std::size_t quoted_size(std::string_view rest) noexcept {
  for (std::size_t size = 1; size < rest.size(); ++size) {
    if (rest[size] == '\\') {
      ++size;
    } else if (rest[size] == rest.front()) {
      return size + 1;
    }
  }
  return 0;
}

}  // namespace

Token Lexer::next() noexcept {
  while (offset_ < text_.size() &&
         std::string_view(" \t\r\n").find(text_[offset_]) != std::string_view::npos)
    ++offset_;
  const std::string_view rest = text_.substr(offset_);
  if (rest.empty()) return {Token::Kind::kEnd, rest, offset_};
  Token token{Token::Kind::kUnknown, rest.substr(0, 1), offset_};
  const bool is_negative =
      minus_ == Minus::kSign && rest.front() == '-' && rest.size() > 1 && is_digit(rest[1]);
  const bool is_quote = rest.front() == '\'' || rest.front() == '"';
  if (is_letter(rest.front())) {
    token.kind = Token::Kind::kWord;
    token.text = rest.substr(0, word_size(rest));
  } else if (is_digit(rest.front()) || is_negative) {
    token.kind = Token::Kind::kNumber;
    token.text = rest.substr(0, number_size(rest));
  } else if (is_quote && quoted_size(rest) > 0) {
    token.kind = Token::Kind::kText;
    token.text = rest.substr(0, quoted_size(rest));
  } else if (std::ranges::find(kTwoCharacterSymbols, rest.substr(0, 2)) !=
             kTwoCharacterSymbols.end()) {
    token.kind = Token::Kind::kSymbol;
    token.text = rest.substr(0, 2);
  } else if (kPunctuation.find(rest.front()) != std::string_view::npos) {
    token.kind = Token::Kind::kSymbol;
  }
  offset_ += token.text.size();
  return token;
}

}  // namespace rtpm::predicate
