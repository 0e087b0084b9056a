#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/predicate/lexer.hpp"
#include "rtpm/predicate/text_error.hpp"

namespace rtpm::predicate {

/// Common base of the recursive-descent parsers for predicates of names and filters of events: the
/// current token, the first error, which ends parsing (from then on the token is kEnd), and the
/// operators `or`, `and`, `not` and parentheses.
class TokenReader {
 protected:
  /// Maximum nesting of parentheses and "not"; bounds the parser's recursion.
  static constexpr int kNestingMax = 100;

  explicit TokenReader(std::string_view text, Minus minus = Minus::kSign) noexcept
      : text_(text), lexer_(text, minus) {
    token_ = lexer_.next();
  }

  void fail(const Token& at, std::string what);
  /// "'word'", or "the end".
  [[nodiscard]] static std::string shown(const Token& token);
  void advance();
  [[nodiscard]] bool is_at(std::string_view text) const;
  bool take(std::string_view text);
  void require(std::string_view text);
  /// Consumes `word`; refuses `symbol`, the spelling in other languages.
  bool take_operator(std::string_view word, std::string_view symbol);
  /// Consumes "not"; refuses "!".
  bool take_not();
  /// Calls `inner` after `begin`, which opens a nested part, unless the nesting is too deep.
  template <class Inner>
  auto nested(const Token& begin, Inner inner) -> decltype(inner()) {
    if (++nesting_ > kNestingMax) fail(begin, "it is nested too deeply");
    decltype(inner()) result = error_ ? decltype(inner()){} : inner();
    --nesting_;
    return result;
  }

  [[nodiscard]] std::string_view text() const noexcept { return text_; }

  Token token_{};
  std::optional<TextError> error_{};

 private:
  std::string_view text_;
  Lexer lexer_;
  int nesting_ = 0;
};

}  // namespace rtpm::predicate
