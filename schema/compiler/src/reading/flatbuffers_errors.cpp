// FlatBuffers' parser reads one token ahead, so its column is that of the token *after* the wrong
// one. This file rewords each message and points at the right token; an unknown message is shown as
// it is. The messages are those of FlatBuffers 2.0.8, by their beginnings, and of newer ones where
// they differ.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "checks/words.hpp"
#include "model/attributes.hpp"
#include "reading/parser.hpp"
#include "reading/tokens.hpp"

namespace rtpm::schema {
namespace {

constexpr const char* kWrapHint =
    "wrap it in a table of its own, or write rtpm.Empty for no content";

bool is_scalar_name(std::string_view name) {
  static constexpr std::string_view kScalars[] = {
      "bool",   "byte",  "ubyte",  "short",   "ushort",  "int",    "uint",   "long",
      "ulong",  "float", "double", "int8",    "uint8",   "int16",  "uint16", "int32",
      "uint32", "int64", "uint64", "float32", "float64", "string", "void"};
  return std::find(std::begin(kScalars), std::end(kScalars), name) != std::end(kScalars);
}

/// The part of the statement at the error that is wrong.
enum class Part : std::uint8_t { kToken, kType, kDefault, kAttribute, kTypeName };

/// Another text for a message. `@` stands for the token at the error (Part::kToken), the type
/// (Part::kTypeName) or the field.
struct Wording {
  std::string_view message{};  ///< Its beginning.
  Part part{};
  std::string_view text{};
  std::string_view hint{};
  std::string_view attribute{};  ///< Of Part::kAttribute.
};

constexpr std::string_view kStructFieldText =
    "field @ of a struct can only be a number, an array, or a struct that is defined above";
constexpr std::string_view kStructFieldHint = "make it a table, or move the inner struct up";

constexpr Wording kWordings[] = {
    {"no root type set to parse json with", Part::kToken, "expected a declaration, found @",
     "a schema contains no data"},
    {"attribute name must be either identifier or string", Part::kToken,
     "expected an attribute's name, found @", "attributes are written (name: value, name)"},
    {"illegal type syntax", Part::kToken, "expected a type, found @"},
    {"expecting: string constant", Part::kToken, "expected a string, found @",
     "put it in quotation marks"},
    {"must specify the underlying integer type for this enum", Part::kToken,
     "the enum's integer type is missing", "write `enum Name : ubyte`, or a larger type"},
    {"Cannot assign token starting with", Part::kToken, "@ is not a value"},
    {"structs may contain only scalar or struct fields", Part::kType, kStructFieldText,
     kStructFieldHint},
    {"Incomplete type in struct is not allowed", Part::kType, kStructFieldText,  // Since 22.12.
     kStructFieldHint},
    {"fixed-length array in table must be wrapped in struct", Part::kType,
     "field @ of a table cannot be an array", "use a vector, or wrap the array in a struct"},
    {"length of fixed-length array must be positive", Part::kType, "array @ has a wrong length",
     "write a whole number from 1 to 65535"},
    {"nested vector types not supported", Part::kType, "field @ is a vector of vectors",
     "wrap the inner vector in a table"},
    {"default values are not supported for struct fields", Part::kDefault,
     "field @ cannot have a default",
     "only numbers and enums of tables have one; a struct's fields are always present"},
    {"default value of `", Part::kDefault, "the default of field @ is not a value of its enum",
     "write one of the enum's values, or `= null`"},
    {"only non-scalar fields in tables may be 'required'", Part::kAttribute,
     "field @ is a number, which cannot be required",
     "a number always has a value; with `= null` its absence shows", "required"},
    {"'key' field must be string", Part::kAttribute, "field @ cannot be a key",
     "a key is a number or a string", "key"},
    {"only one field may be set as 'key'", Part::kAttribute, "field @ is a second key",
     "a table is sorted by one field: remove one of the two", "key"},
    {"unexpected force_align value", Part::kAttribute, "force_align cannot have this value",
     "write a power of two, from the struct's own alignment up to 16", "force_align"},
    {"either all fields or no fields must have an 'id' attribute", Part::kTypeName,
     "some fields of @ have an id, and some have none",
     "give every field its id, in the order in which the fields were added, or none"},
};

class Translation {
 public:
  Translation(const RawError& error, const SourceFile& source, const ParsedSoFar& parsed)
      : error_(error), source_(source), parsed_(parsed), tokens_(tokenize(source)) {
    const std::size_t cursor = source.offset_of(error.line, error.column_byte);
    while (at_ + 1 < tokens_.size() && tokens_[at_ + 1].offset < cursor)
      ++at_;
  }

  Diagnostic translate() const {
    using Rule = std::optional<Diagnostic> (Translation::*)() const;
    // The first rule that knows the message applies; the general ones come last.
    static constexpr Rule kRules[] = {
        &Translation::unknown_attribute, &Translation::attribute_value,
        &Translation::empty_service,     &Translation::method_form,
        &Translation::not_a_table,       &Translation::undefined_type,
        &Translation::missing_include,   &Translation::already_exists,
        &Translation::text_error,        &Translation::comment_error,
        &Translation::field_ids,         &Translation::other_statement,
        &Translation::reworded,          &Translation::missing_end,
        &Translation::unexpected_token,
    };
    for (const Rule rule : kRules) {
      if (auto diagnostic = (this->*rule)()) return *std::move(diagnostic);
    }
    return as_it_is();
  }

 private:
  /// The rest of a message that begins with `prefix`.
  [[nodiscard]] std::optional<std::string> after(std::string_view prefix) const {
    if (!error_.message.starts_with(prefix)) return std::nullopt;
    return error_.message.substr(prefix.size());
  }
  [[nodiscard]] bool is(std::string_view message) const { return error_.message == message; }
  [[nodiscard]] Diagnostic at(Span span, std::string message, std::string hint) const {
    return {source_.locate(span), std::move(message), std::move(hint), std::nullopt};
  }
  [[nodiscard]] Diagnostic here(std::string message, std::string hint) const {
    return at(tokens_[at_].span(), std::move(message), std::move(hint));
  }
  /// The token `count` tokens before the error's.
  [[nodiscard]] const Token& before(std::size_t count) const {
    return tokens_[at_ >= count ? at_ - count : 0];
  }
  /// The last token with this text, up to the error's; the error's if there is none.
  [[nodiscard]] std::size_t find_back(std::string_view text) const {
    for (std::size_t i = at_ + 1; i-- > 0;) {
      if (tokens_[i].value() == text) return i;
    }
    return at_;
  }
  /// The innermost bracket of this kind that is open at the token `from`.
  [[nodiscard]] std::optional<std::size_t> open_bracket(std::string_view open,
                                                        std::string_view close,
                                                        std::size_t from) const {
    std::size_t closed = 0;
    for (std::size_t i = from + 1; i-- > 0;) {
      if (tokens_[i].is(close)) ++closed;
      if (tokens_[i].is(open) && closed-- == 0) return i;
    }
    return std::nullopt;
  }
  [[nodiscard]] bool is_in_service() const {
    const auto brace = open_bracket("{", "}", at_);
    for (std::size_t i = brace.value_or(0); i-- > 0;) {
      if (tokens_[i].is(";") || tokens_[i].is("}")) return false;
      if (tokens_[i].is("rpc_service")) return true;
    }
    return false;
  }

  [[nodiscard]] std::optional<Diagnostic> unknown_attribute() const {
    const auto name = after("user define attributes must be declared before use: ");
    if (!name) return std::nullopt;
    return here("unknown attribute `" + *name + '`',
                is_known_attribute(*name)
                    ? "write `include \"rtpm.fbs\";` at the top: it declares RTPM's attributes"
                    : unknown_attribute_hint(*name));
  }

  /// Values of attributes are strings or whole numbers below 2³¹.
  [[nodiscard]] std::optional<Diagnostic> attribute_value() const {
    const bool is_kind = after("Cannot assign token starting with").has_value();
    if (!is_kind && !after("invalid number: ")) return std::nullopt;
    // A too large number is noticed one token later, at the comma or parenthesis.
    const bool is_behind = !is_kind && tokens_[at_].kind == TokenKind::kPunctuation && at_ > 0;
    const std::size_t value = is_behind ? at_ - 1 : at_;
    const auto parenthesis = open_bracket("(", ")", value > 0 ? value - 1 : 0);
    if (value < 2 || !parenthesis || *parenthesis > value || !tokens_[value - 1].is(":")) {
      return std::nullopt;
    }
    const std::string name(tokens_[value - 2].value());
    const std::string hint = value_hint(name);
    return at(tokens_[value].span(),
              '`' + std::string(tokens_[value].text) + "` is not a value of `" + name + '`',
              hint.empty() ? "a value is a string or a whole number below 2147483648" : hint);
  }

  [[nodiscard]] std::optional<Diagnostic> empty_service() const {
    if (!is("expecting: identifier instead got: }") || !before(1).is("{") || at_ < 2) {
      return std::nullopt;
    }
    // Attributes may follow the service's name, so search back to the statement's beginning.
    for (std::size_t i = at_ - 1; i-- > 0 && !tokens_[i].is(";") && !tokens_[i].is("}");) {
      if (!tokens_[i].is("rpc_service")) continue;
      return at(tokens_[i + 1].span(),
                "service `" + std::string(tokens_[i + 1].text) + "` has no methods",
                "write one, such as `ping(rtpm.Empty):rtpm.Empty (rtpm_id: 1);`, or remove it");
    }
    return std::nullopt;
  }

  /// Common mistakes in `name(Request):Reply (attributes);`.
  [[nodiscard]] std::optional<Diagnostic> method_form() const {
    if (!is_in_service()) return std::nullopt;
    if (is("expecting: identifier instead got: )") && before(1).is("(")) {
      return here("a method has exactly one request, and there is none",
                  "write rtpm.Empty for a request without content");
    }
    if (is("expecting: ) instead got: ,")) {
      return here("a method has exactly one request, and there are more",
                  "make them the fields of one table");
    }
    if (is("expecting: : instead got: ;") || is("expecting: : instead got: (")) {
      return here("a method has a reply, and there is none",
                  "write `:rtpm.Empty` for a reply without content");
    }
    if (is("expecting: identifier instead got: [")) {
      return here("a request or reply must be a table, not a vector", kWrapHint);
    }
    return std::nullopt;
  }

  /// The parser has read `name(Request):Reply` and one token more.
  [[nodiscard]] std::optional<Diagnostic> not_a_table() const {
    if (!is("rpc request and response types must be tables")) return std::nullopt;
    std::size_t colon = at_;
    while (colon > 1 && !tokens_[colon].is(":"))
      --colon;
    const auto [request, request_span] = type_before(colon - 1);
    const std::string request_kind = parsed_.kind_of(request);
    if (!request_kind.empty() && request_kind != "table") {
      return not_a_table_at(request_span, "request", request, request_kind);
    }
    const auto [reply, reply_span] = type_before(at_);
    return not_a_table_at(reply_span, "reply", reply, parsed_.kind_of(reply));
  }

  [[nodiscard]] Diagnostic not_a_table_at(Span span, const std::string& role,
                                          const std::string& type, const std::string& kind) const {
    return at(span,
              "a " + role + " must be a table, and `" + type + "` is " +
                  (kind.empty() ? "not one" : with_article(kind)),
              kind == "struct" ? wrap_struct_hint(type) : kWrapHint);
  }

  /// The type's name that ends right before token `end`, dots included.
  [[nodiscard]] std::pair<std::string, Span> type_before(std::size_t end) const {
    std::size_t begin = end;
    while (begin > 0 && (tokens_[begin - 1].is_identifier() || tokens_[begin - 1].is(".")))
      --begin;
    std::string name;
    for (std::size_t i = begin; i < end; ++i)
      name += tokens_[i].text;
    const std::size_t offset = tokens_[begin].offset;
    return {name, {offset, end > begin ? tokens_[end - 1].end() - offset : 0}};
  }

  /// Detected after all files were read; the message has the file and line of the use.
  [[nodiscard]] std::optional<Diagnostic> undefined_type() const {
    const auto rest = after("type referenced but not defined (check namespace): ");
    if (!rest) return std::nullopt;
    constexpr std::string_view kOrigin = ", originally at: ";
    const std::size_t origin = rest->find(kOrigin);
    const std::string name = rest->substr(0, origin);
    Location location{.file = source_.path()};
    if (origin != std::string::npos) {
      const std::string place = rest->substr(origin + kOrigin.size());
      const std::size_t colon = place.rfind(':');
      const char* line = place.c_str() + (colon == std::string::npos ? place.size() : colon + 1);
      location = place_of_type(name, place.substr(0, colon),
                               static_cast<std::size_t>(std::strtoul(line, nullptr, 10)));
    }
    if (is_scalar_name(name)) {
      return Diagnostic{location, "a request or reply must be a table, not `" + name + '`',
                        kWrapHint, std::nullopt};
    }
    // The parser accepts tables and structs in any order, but not enums and unions.
    if (const std::string kind = parsed_.kind_of(name); kind == "enum" || kind == "union") {
      return Diagnostic{location, kind + " `" + name + "` is used before it is defined",
                        "move the " + kind + " above its first use", std::nullopt};
    }
    std::string hint = "check the spelling, the namespace, and that its file is included";
    if (name == "rtpm.Empty" || name == "Empty") {
      hint = "write `include \"rtpm.fbs\";` at the top and `rtpm.Empty` here";
    } else if (const std::string similar = parsed_.similar_type(name); !similar.empty()) {
      hint = "did you mean `" + similar + "`?";
    }
    return Diagnostic{location, "type `" + name + "` is not defined", hint, std::nullopt};
  }

  /// Where `name` is used on `line` of `file`, or last before: reading one token ahead, the parser
  /// may have been on a later line.
  [[nodiscard]] Location place_of_type(const std::string& name, const std::string& file,
                                       std::size_t line) const {
    const bool is_here = file.empty() || file == source_.path();
    const auto other = is_here ? std::nullopt : SourceFile::read(file);
    const SourceFile& source = other ? *other : source_;
    const std::string first_part = name.substr(0, name.find('.'));
    std::optional<Location> found;
    for (const Token& token : tokenize(source)) {
      if (!token.is(first_part) ||
          !std::string_view(source.text()).substr(token.offset).starts_with(name)) {
        continue;
      }
      const Location location = source.locate({token.offset, name.size()});
      if (location.line > line) break;
      if (!found || location.line != found->line) found = location;
    }
    return found.value_or(Location{.file = file});
  }

  [[nodiscard]] std::optional<Diagnostic> missing_include() const {
    auto name = after("unable to load include file: ");
    if (!name) name = after("unable to locate include file: ");
    if (!name) return std::nullopt;
    std::string hint = "it is searched in the folder of this file and in those given with -I";
    if (*name == "rtpm.fbs") hint += "; RTPM's own schemas are in its folder schema/idl";
    return at(tokens_[find_back(*name)].span(), "cannot find the included file \"" + *name + '"',
              hint);
  }

  [[nodiscard]] std::optional<Diagnostic> already_exists() const {
    using Kind = std::pair<std::string_view, std::string_view>;
    for (const auto& [kind, word] :
         {Kind{"service", "service"}, Kind{"rpc", "method"}, Kind{"field", "field"},
          Kind{"datatype", "type"}, Kind{"enum", "enum"}, Kind{"enum value", "value"}}) {
      const auto name = after(std::string(kind) + " already exists: ");
      if (!name) continue;
      const std::string last = name->substr(name->rfind('.') + 1);
      return at(tokens_[find_definition(last, kind)].span(),
                std::string(word) + " `" + last + "` is defined twice",
                "rename or remove one of the two");
    }
    return std::nullopt;
  }

  /// The last definition of `name` before the error. A data type may be used inside its own braces.
  [[nodiscard]] std::size_t find_definition(std::string_view name, std::string_view kind) const {
    if (kind != "datatype" && kind != "enum") return find_back(name);
    for (std::size_t i = at_ + 1; i-- > 1;) {
      const Token& keyword = tokens_[i - 1];
      if (tokens_[i].is(name) && (keyword.is("table") || keyword.is("struct") ||
                                  keyword.is("enum") || keyword.is("union"))) {
        return i;
      }
    }
    return find_back(name);
  }

  /// Errors of the text itself.
  [[nodiscard]] std::optional<Diagnostic> text_error() const {
    if (is("input file is empty")) {
      return Diagnostic{Location{.file = source_.path()}, "the schema is empty",
                        "write at least a table, a struct, an enum or an rpc_service",
                        std::nullopt};
    }
    if (is("illegal character in string constant")) {
      return here("the string does not end on its line", "close it with a quotation mark");
    }
    if (!after("illegal character: ")) return std::nullopt;
    // The parser is past the byte, which may be the first of several of a character.
    const std::size_t cursor = source_.offset_of(error_.line, error_.column_byte);
    const std::size_t begin = cursor > 0 ? cursor - 1 : 0;
    std::size_t end = cursor;
    while (end < source_.text().size() && (source_.text()[end] & 0xC0) == 0x80)
      ++end;
    return at({begin, end - begin},
              "`" + source_.text().substr(begin, end - begin) + "` is not allowed here",
              "a name has the letters a to z and A to Z, digits and `_`");
  }

  /// Comments are not tokens, so their places are found in the text.
  [[nodiscard]] std::optional<Diagnostic> comment_error() const {
    const std::size_t cursor = source_.offset_of(error_.line, error_.column_byte);
    if (is("end of file in comment")) {
      const std::size_t begin = source_.text().rfind("/*");
      return at({std::min(begin, cursor), 2}, "the comment does not end", "close it with `*/`");
    }
    if (is("a documentation comment should be on a line on its own")) {
      const std::size_t begin = source_.text().rfind("///", cursor);
      return at({std::min(begin, cursor), 3}, "a `///` comment must have a line of its own",
                "move it above what it describes, or write `//`");
    }
    return std::nullopt;
  }

  /// The first token of the field's or value's statement at the error.
  [[nodiscard]] std::size_t statement_begin() const {
    std::size_t begin = at_;
    while (begin > 0 && !tokens_[begin - 1].is(";") && !tokens_[begin - 1].is("{"))
      --begin;
    return begin;
  }

  /// The statement's tokens from `begin` up to one of `ends`.
  [[nodiscard]] Span tokens_until(std::size_t begin, std::string_view ends) const {
    std::size_t end = begin;
    while (end + 1 < tokens_.size() && ends.find(tokens_[end].text) == ends.npos)
      ++end;
    if (end == begin) return tokens_[begin].span();
    return {tokens_[begin].offset, tokens_[end - 1].end() - tokens_[begin].offset};
  }

  /// Where `wording` points; `subject` is the token that its `@` stands for.
  [[nodiscard]] Span span_of(const Wording& wording, std::size_t subject) const {
    switch (wording.part) {
      case Part::kType:
        return subject + 2 < tokens_.size() ? tokens_until(subject + 2, "=;(")
                                            : tokens_[at_].span();
      case Part::kDefault:
        for (std::size_t i = subject; i + 1 < tokens_.size() && i <= at_; ++i) {
          if (tokens_[i].is("=")) return tokens_[i + 1].span();
        }
        return tokens_[at_].span();
      case Part::kAttribute:
        return tokens_[find_back(wording.attribute)].span();
      case Part::kToken:
      case Part::kTypeName:
        break;
    }
    return tokens_[subject].span();
  }

  [[nodiscard]] std::size_t subject_of(const Wording& wording) const {
    if (wording.part == Part::kToken) return at_;
    if (wording.part != Part::kTypeName) return statement_begin();
    const auto brace = open_bracket("{", "}", at_ > 0 ? at_ - 1 : 0);
    return brace && *brace > 0 ? *brace - 1 : at_;
  }

  [[nodiscard]] std::optional<Diagnostic> reworded() const {
    for (const Wording& wording : kWordings) {
      if (!after(wording.message)) continue;
      const std::size_t subject = subject_of(wording);
      std::string text(wording.text);
      if (const std::size_t mark = text.find('@'); mark != std::string::npos) {
        text.replace(mark, 1, '`' + std::string(tokens_[subject].text) + '`');
      }
      return at(span_of(wording, subject), std::move(text), std::string(wording.hint));
    }
    return std::nullopt;
  }

  /// "… id 1 missing or set twice, field: y, id: 0", found when the table ends.
  [[nodiscard]] std::optional<Diagnostic> field_ids() const {
    const auto rest = after("field id's must be consecutive from 0, id ");
    if (!rest) return std::nullopt;
    constexpr std::string_view kField = "field: ";
    const std::size_t begin = rest->find(kField);
    if (begin == std::string::npos) return std::nullopt;
    const std::size_t name_at = begin + kField.size();
    const std::string name = rest->substr(name_at, rest->find(',', name_at) - name_at);
    return at(tokens_[find_back(name)].span(),
              "the field ids of the table skip " + rest->substr(0, rest->find(' ')) +
                  ", or repeat a number, at field `" + name + '`',
              "ids are 0, 1, 2 and so on, without a gap; a union takes two, of which it names the "
              "second");
  }

  [[nodiscard]] std::optional<Diagnostic> other_statement() const {
    if (const auto name = after("unknown root type: ")) {
      const std::string similar = parsed_.similar_type(*name);
      return at(
          tokens_[find_back(*name)].span(), "the root type `" + *name + "` is not defined",
          similar.empty() ? "define the table above this line" : "did you mean `" + similar + "`?");
    }
    if (after("file_identifier must be exactly")) {
      return at(before(1).span(), "a file identifier has exactly 4 characters", "");
    }
    if (const auto rest = after("enum value does not fit, \"")) {
      const std::string value = rest->substr(0, rest->find('"'));
      return at(tokens_[find_back(value)].span(), '`' + value + "` does not fit the enum's type",
                "use a larger type: `enum Name : ushort`");
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<Diagnostic> missing_end() const {
    if (!error_.message.starts_with("expecting: ")) return std::nullopt;
    if (is("expecting: ; instead got: end of file") || !error_.message.ends_with("end of file")) {
      if (!after("expecting: ; instead got: ")) return std::nullopt;
      const Token& last = error_.message.ends_with("end of file") ? before(0) : before(1);
      return at({last.end(), 0}, "expected `;` after `" + std::string(last.text) + '`', "");
    }
    Diagnostic diagnostic = at({before(0).end(), 0}, "the file ends inside a declaration", "");
    if (const auto brace = open_bracket("{", "}", at_)) {
      diagnostic.note = Note{source_.locate(tokens_[*brace].span()), "this `{` is not closed"};
    }
    return diagnostic;
  }

  [[nodiscard]] std::optional<Diagnostic> unexpected_token() const {
    const std::string found = '`' + std::string(tokens_[at_].text) + '`';
    if (is("declaration expected")) {
      static constexpr std::string_view kDeclarations[] = {
          "namespace", "table",     "struct",          "enum",           "union",  "rpc_service",
          "attribute", "root_type", "file_identifier", "file_extension", "include"};
      const std::string similar = most_similar(tokens_[at_].text, kDeclarations);
      return here("expected a declaration, found " + found,
                  similar.empty() ? "declarations are table, struct, enum, union and rpc_service"
                                  : "did you mean `" + similar + "`?");
    }
    const auto rest = after("expecting: ");
    if (!rest) return std::nullopt;
    std::string wanted = rest->substr(0, rest->find(" instead got: "));
    if (wanted.size() == 1) wanted = '`' + wanted + '`';
    if (wanted == "identifier") wanted = "a name";
    return here("expected " + wanted + ", found " + found, "");
  }

  [[nodiscard]] Diagnostic as_it_is() const {
    // Many messages name their subject, in quotes or at the end: point at it if it was just read.
    const std::string& message = error_.message;
    std::string name;
    if (const std::size_t quote = message.find('"'); quote != std::string::npos) {
      name = message.substr(quote + 1, message.find('"', quote + 1) - quote - 1);
    } else if (const std::size_t colon = message.rfind(": "); colon != std::string::npos) {
      name = message.substr(colon + 2);
    }
    const std::size_t named = find_back(name);
    return at(tokens_[at_ - named <= 12 ? named : at_].span(), message, "");
  }

  const RawError& error_;
  const SourceFile& source_;
  const ParsedSoFar& parsed_;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;  // The last token that the parser read.
};

}  // namespace

Diagnostic translate(const RawError& error, const SourceFile& source, const ParsedSoFar& parsed) {
  return Translation(error, source, parsed).translate();
}

}  // namespace rtpm::schema
