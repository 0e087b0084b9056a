#include "rtpm/predicate/token_reader.hpp"

#include <utility>

#include "rtpm/base/printable.hpp"

namespace rtpm::predicate {

void TokenReader::fail(const Token& at, std::string what) {
  if (!error_) error_ = TextError{at.offset, std::move(what)};
  token_ = {Token::Kind::kEnd, {}, text_.size()};
}

std::string TokenReader::shown(const Token& token) {
  return token.kind == Token::Kind::kEnd ? "the end" : "'" + printable(token.text) + "'";
}

void TokenReader::advance() {
  if (!error_) token_ = lexer_.next();
}

bool TokenReader::is_at(std::string_view text) const {
  return token_.kind != Token::Kind::kEnd && token_.text == text;
}

bool TokenReader::take(std::string_view text) {
  const bool is_there = is_at(text);
  if (is_there) advance();
  return is_there;
}

void TokenReader::require(std::string_view text) {
  if (!take(text)) fail(token_, "expected '" + std::string(text) + "', not " + shown(token_));
}

bool TokenReader::take_operator(std::string_view word, std::string_view symbol) {
  if (is_at(symbol)) fail(token_, "write '" + std::string(word) + "'");
  return take(word);
}

bool TokenReader::take_not() {
  if (is_at("!")) fail(token_, "write 'not'");
  return take("not");
}

}  // namespace rtpm::predicate
