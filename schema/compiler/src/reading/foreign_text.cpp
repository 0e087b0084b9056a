#include "reading/foreign_text.hpp"

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "reading/tokens.hpp"

namespace rtpm::schema {
namespace {

constexpr const char* kLimitHint = "such a schema is read from a .fbs file only, by rtpmc";
constexpr const char* kGrammarHint = "a server sends what rtpmc generates: types and services";

bool is_control(char c) noexcept {
  return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
}

/// The first character at which FlatBuffers' tokens might differ from tokenize()'s: a control
/// character, such as a carriage return in a comment, which ends the comment only for FlatBuffers.
std::optional<std::size_t> find_control(std::string_view text) noexcept {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!is_control(text[i]) || text[i] == '\n' || text[i] == '\t') continue;
    if (text[i] == '\r' && i + 1 < text.size() && text[i + 1] == '\n') continue;
    return i;
  }
  return std::nullopt;
}

bool is_number(std::string_view text) noexcept {
  if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
  if (text.starts_with("0x")) {
    text.remove_prefix(2);
    return !text.empty() && text.find_first_not_of("0123456789abcdefABCDEF") == text.npos;
  }
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

/// Parses without recursion, because the grammar has no nesting.
class ForeignReader {
 public:
  explicit ForeignReader(const SourceFile& source) : source_(source), tokens_(tokenize(source)) {}

  std::optional<Diagnostic> read() {
    while (!error_ && !at_end())
      read_statement();
    return std::move(error_);
  }

 private:
  [[nodiscard]] const Token& token() const { return tokens_[at_]; }
  [[nodiscard]] bool at_end() const { return token().kind == TokenKind::kEnd; }
  void next() {
    if (!at_end()) ++at_;
  }

  void fail(std::string message, const char* hint) {
    if (!error_) error_ = {source_.locate(token().span()), std::move(message), hint, std::nullopt};
  }
  void fail_expected(const std::string& what) {
    fail("expected " + what + " here, in a schema of another program", kGrammarHint);
  }
  void count(std::size_t& number, std::size_t number_max, const char* what) {
    if (++number <= number_max) return;
    fail("a schema of another program has at most " + std::to_string(number_max) + what,
         kLimitHint);
  }

  bool take(std::string_view text) {
    if (!token().is(text)) return false;
    next();
    return true;
  }
  void require(std::string_view text) {
    if (!take(text)) fail_expected("`" + std::string(text) + "`");
  }
  void require_identifier() {
    if (!token().is_identifier()) return fail_expected("a name");
    std::size_t size = token().text.size() - 1;
    count(size, ForeignLimits::kNameSizeMax, " bytes in a name");
    next();
  }
  void require_string() {
    const std::string_view text = token().text;
    const bool is_whole = text.size() >= 2 && text.front() == text.back();
    if (token().kind != TokenKind::kString || !is_whole || text.find('\\') != text.npos) {
      return fail_expected("a text without escapes");
    }
    next();
  }
  void require_number() {
    if (token().kind != TokenKind::kNumber || !is_number(token().text)) {
      return fail_expected("a number");
    }
    next();
  }
  void require_dotted_name() {
    std::size_t part_count = 0;
    do {
      count(part_count, ForeignLimits::kNamePartMax, " parts in a name");
      require_identifier();
    } while (!error_ && take("."));
  }

  void read_statement() {
    count(statement_count_, ForeignLimits::kStatementMax, " declarations");
    const Token keyword = token();
    if (take("table") || take("struct")) return read_members(&ForeignReader::read_field);
    if (take("rpc_service")) return read_members(&ForeignReader::read_method);
    if (take("enum")) return read_values(true);
    if (take("union")) return read_values(false);
    if (take("namespace") || take("root_type")) {
      // `namespace ;` means the global namespace.
      if (!keyword.is("namespace") || !token().is(";")) require_dotted_name();
    } else if (take("attribute") || take("file_identifier") || take("file_extension")) {
      if (keyword.is("attribute") && token().is_identifier()) {
        next();
      } else {
        require_string();
      }
    } else {
      return fail_expected("a declaration");
    }
    require(";");
  }

  void read_attributes() {
    if (!take("(")) return;
    std::size_t attribute_count = 0;
    do {
      count(attribute_count, ForeignLimits::kAttributeMax, " attributes of one declaration");
      require_identifier();
      if (!take(":")) continue;
      if (token().kind == TokenKind::kString) {
        require_string();
      } else if (token().is_identifier()) {
        next();
      } else {
        require_number();
      }
    } while (!error_ && take(","));
    require(")");
  }

  void read_members(void (ForeignReader::*read_member)()) {
    require_identifier();
    read_attributes();
    require("{");
    while (!error_ && !take("}")) {
      count(member_count_, ForeignLimits::kMemberMax, " fields, values and methods");
      (this->*read_member)();
    }
  }

  /// Parses `name : type = default (attributes);`.
  void read_field() {
    require_identifier();
    require(":");
    if (take("[")) {
      require_dotted_name();
      if (take(":")) require_number();
      require("]");
    } else {
      require_dotted_name();
    }
    if (take("=")) read_default();
    read_attributes();
    require(";");
  }

  void read_default() {
    if (token().kind == TokenKind::kString) return require_string();
    if (token().kind == TokenKind::kNumber) return require_number();
    if (take("[")) return require("]");
    if (!take("-")) take("+");  // The sign of an infinity.
    require_dotted_name();
  }

  /// Parses `name(request):reply (attributes);`.
  void read_method() {
    count(method_count_, ForeignLimits::kMethodMax, " methods");
    require_identifier();
    require("(");
    require_dotted_name();
    require(")");
    require(":");
    require_dotted_name();
    read_attributes();
    require(";");
  }

  /// Parses `Name : type (attributes) { a = 1, b }` of an enum, or `Name { alias:lab.Type, Type }`
  /// of a union.
  void read_values(bool is_enum) {
    require_identifier();
    if (is_enum) {
      require(":");
      require_identifier();
    }
    read_attributes();
    require("{");
    std::size_t value_count = 0;
    while (!error_ && !take("}")) {
      count(member_count_, ForeignLimits::kMemberMax, " fields, values and methods");
      count(value_count, ForeignLimits::kEnumValueMax, " values of one enum or union");
      require_dotted_name();
      if (is_enum && take("=")) require_number();
      if (!is_enum && take(":")) require_dotted_name();
      if (!take(",") && !token().is("}")) fail_expected("`,` or `}`");
    }
  }

  const SourceFile& source_;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  std::size_t statement_count_ = 0;
  std::size_t member_count_ = 0;
  std::size_t method_count_ = 0;
  std::optional<Diagnostic> error_{};
};

}  // namespace

std::optional<Diagnostic> refuse_foreign(const SourceFile& source) {
  if (source.text().size() > ForeignLimits::kByteMax) {
    return Diagnostic{Location{.file = source.path()},
                      "a schema of another program has at most " +
                          std::to_string(ForeignLimits::kByteMax) + " bytes",
                      kLimitHint, std::nullopt};
  }
  if (const auto control = find_control(source.text())) {
    Location location = source.locate({*control, 1});
    location.line_text.clear();
    return Diagnostic{std::move(location), "a control character, in a schema of another program",
                      kGrammarHint, std::nullopt};
  }
  return ForeignReader(source).read();
}

}  // namespace rtpm::schema
