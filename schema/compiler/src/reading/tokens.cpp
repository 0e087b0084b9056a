#include "reading/tokens.hpp"

#include <algorithm>

namespace rtpm::schema {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_word_start(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool is_word(char c) {
  return is_word_start(c) || is_digit(c);
}

/// The offset after the white space and comments that start at `at`.
std::size_t skip_space(std::string_view text, std::size_t at) {
  while (at < text.size()) {
    if (text[at] == ' ' || text[at] == '\t' || text[at] == '\r' || text[at] == '\n') {
      ++at;
    } else if (text.substr(at, 2) == "//") {
      at = std::min(text.find('\n', at), text.size());
    } else if (text.substr(at, 2) == "/*") {
      const std::size_t end = text.find("*/", at + 2);
      at = end == std::string_view::npos ? text.size() : end + 2;
      // The byte order mark that some editors write.
    } else if (text.substr(at, 3) == "\xEF\xBB\xBF") {
      at += 3;
    } else {
      break;
    }
  }
  return at;
}

std::size_t end_of_string(std::string_view text, std::size_t begin) {
  std::size_t at = begin + 1;
  while (at < text.size() && text[at] != text[begin] && text[at] != '\n') {
    at += text[at] == '\\' ? std::size_t{2} : std::size_t{1};
  }
  return std::min(at + 1, text.size());
}

std::size_t end_of_number(std::string_view text, std::size_t begin) {
  std::size_t at = begin + 1;
  while (at < text.size()) {
    const bool is_sign = (text[at] == '+' || text[at] == '-') &&
                         std::string_view("eEpP").find(text[at - 1]) != std::string_view::npos;
    if (!is_word(text[at]) && text[at] != '.' && !is_sign) break;
    ++at;
  }
  return at;
}

Token token_at(std::string_view text, std::size_t begin) {
  const char first = text[begin];
  const char second = begin + 1 < text.size() ? text[begin + 1] : '\0';
  TokenKind kind = TokenKind::kPunctuation;
  std::size_t end = begin + 1;
  if (is_word_start(first)) {
    kind = TokenKind::kIdentifier;
    while (end < text.size() && is_word(text[end]))
      ++end;
  } else if (is_digit(first) ||
             ((first == '-' || first == '+' || first == '.') && is_digit(second))) {
    kind = TokenKind::kNumber;
    end = end_of_number(text, begin);
  } else if (first == '"' || first == '\'') {
    kind = TokenKind::kString;
    end = end_of_string(text, begin);
  }
  return {kind, text.substr(begin, end - begin), begin};
}

}  // namespace

std::string_view Token::value() const noexcept {
  if (kind != TokenKind::kString) return text;
  return text.size() < 2 ? std::string_view{} : text.substr(1, text.size() - 2);
}

std::vector<Token> tokenize(const SourceFile& source) {
  const std::string_view text = source.text();
  std::vector<Token> tokens;
  std::size_t at = skip_space(text, 0);
  while (at < text.size()) {
    tokens.push_back(token_at(text, at));
    at = skip_space(text, tokens.back().end());
  }
  tokens.push_back({TokenKind::kEnd, {}, text.size()});
  return tokens;
}

}  // namespace rtpm::schema
