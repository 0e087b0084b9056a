// FlatBuffers' parser says what is wrong, but its column is that of the word *behind* the wrong one
// (it reads one word ahead) and its words are for those who know it. Here each message is put in
// RTPM's words, at the word that it is about. A message that is not known here is shown as it is.
#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "attributes.hpp"
#include "parser.hpp"
#include "tokens.hpp"

namespace rtpm::schema {
namespace {

/// An error with what is needed to find its place.
class Translation {
 public:
  Translation(const RawError& error, const SourceFile& source, const ParsedSoFar& parsed)
      : error_(error), source_(source), parsed_(parsed), tokens_(tokenize(source)) {
    const std::size_t cursor = source.offset_of(error.line, error.column_byte);
    while (at_ + 1 < tokens_.size() && tokens_[at_ + 1].offset < cursor)
      ++at_;
  }

  Diagnostic translate() {
    if (auto known = unknown_attribute()) return *std::move(known);
    if (auto known = empty_service()) return *std::move(known);
    if (auto known = not_a_table()) return *std::move(known);
    if (auto known = undefined_type()) return *std::move(known);
    if (auto known = missing_include()) return *std::move(known);
    if (auto known = already_exists()) return *std::move(known);
    if (auto known = unexpected_word()) return *std::move(known);
    return as_it_is();
  }

 private:
  /// What follows `prefix` in the message; nothing if the message does not begin so.
  [[nodiscard]] std::optional<std::string> after(std::string_view prefix) const {
    if (!error_.message.starts_with(prefix)) return std::nullopt;
    return error_.message.substr(prefix.size());
  }
  [[nodiscard]] Diagnostic at(Span span, std::string message, std::string hint) const {
    return {source_.locate(span), std::move(message), std::move(hint), std::nullopt};
  }
  /// The last word before the error (itself included) with this text, else the error's own word.
  [[nodiscard]] std::size_t find_back(std::string_view text) const {
    for (std::size_t i = at_ + 1; i-- > 0;) {
      if (tokens_[i].value() == text) return i;
    }
    return at_;
  }
  [[nodiscard]] const Token& before(std::size_t count) const {
    return tokens_[at_ >= count ? at_ - count : 0];
  }

  std::optional<Diagnostic> unknown_attribute() const {
    const auto name = after("user define attributes must be declared before use: ");
    if (!name) return std::nullopt;
    const std::string hint =
        is_known_attribute(*name)
            ? "write `include \"rtpm.fbs\";` at the top: it declares RTPM's attributes"
            : unknown_attribute_hint(*name);
    return at(tokens_[at_].span(), "unknown attribute `" + *name + "`", hint);
  }

  std::optional<Diagnostic> empty_service() const {
    if (error_.message != "expecting: identifier instead got: }" || !before(1).is("{")) {
      return std::nullopt;
    }
    // Behind the service's name there may be attributes, so look back to the begin of the
    // statement.
    for (std::size_t i = at_ - 1; i-- > 0;) {
      if (tokens_[i].is(";") || tokens_[i].is("}")) break;
      if (!tokens_[i].is("rpc_service")) continue;
      return at(
          tokens_[i + 1].span(),
          "service `" + std::string(tokens_[i + 1].text) + "` has no methods",
          "give it a method, such as `ping(rtpm.Empty):rtpm.Empty (rtpm_id: 1);`, or remove it");
    }
    return std::nullopt;
  }

  /// The parser has read `name(Request):Reply` and one word more.
  std::optional<Diagnostic> not_a_table() const {
    if (error_.message != "rpc request and response types must be tables") return std::nullopt;
    const auto [reply, reply_span] = type_before(at_);
    std::size_t colon = at_;
    while (colon > 0 && !tokens_[colon].is(":"))
      --colon;
    const auto [request, request_span] = type_before(colon > 0 ? colon - 1 : 0);
    const std::string request_kind = parsed_.kind_of(request);
    const bool is_request = request_kind != "table" && !request_kind.empty();
    return not_a_table_at(is_request ? request_span : reply_span, is_request ? "request" : "reply",
                          is_request ? request : reply,
                          is_request ? request_kind : parsed_.kind_of(reply));
  }

  [[nodiscard]] Diagnostic not_a_table_at(Span span, const std::string& role,
                                          const std::string& type, const std::string& kind) const {
    const std::string hint =
        kind == "struct"
            ? "wrap it: `table " + type + "Message { value:" + type +
                  " (required); }`; on the wire that is the bare struct, so it costs nothing"
            : "wrap it in a table of its own, or use rtpm.Empty where there is nothing to say";
    return at(span,
              "a " + role + " must be a table, and `" + type + "` is " +
                  (kind == "enum" ? "an " : "a ") + (kind.empty() ? "different type" : kind),
              hint);
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

  /// Found at the end of all files; the message says in which one and on which line the type is
  /// used.
  std::optional<Diagnostic> undefined_type() const {
    const auto rest = after("type referenced but not defined (check namespace): ");
    if (!rest) return std::nullopt;
    constexpr std::string_view kOrigin = ", originally at: ";
    const std::size_t origin = rest->find(kOrigin);
    const std::string name = rest->substr(0, origin);
    std::string file = source_.path();
    std::size_t line = 0;
    if (origin != std::string::npos) {
      const std::string place = rest->substr(origin + kOrigin.size());
      const std::size_t colon = place.rfind(':');
      file = place.substr(0, colon);
      line = static_cast<std::size_t>(std::atol(place.c_str() + colon + 1));
    }
    static constexpr std::string_view kScalars[] = {
        "bool",  "byte",   "ubyte",  "short",  "ushort",  "int",     "uint",  "long",
        "ulong", "float",  "double", "string", "int8",    "uint8",   "int16", "uint16",
        "int32", "uint32", "int64",  "uint64", "float32", "float64", "void"};
    const bool is_scalar =
        std::find(std::begin(kScalars), std::end(kScalars), name) != std::end(kScalars);
    Diagnostic diagnostic;
    diagnostic.location = place_of_type(name, file, line);
    diagnostic.message = is_scalar ? "a request or reply must be a table, not `" + name + "`"
                                   : "type `" + name + "` is not defined";
    diagnostic.hint =
        is_scalar ? "wrap it in a table of its own, or use rtpm.Empty where there is nothing to say"
                  : "check the spelling, the namespace, and that its file is included";
    if (name == "rtpm.Empty" || name == "Empty") {
      diagnostic.hint = "write `include \"rtpm.fbs\";` at the top and `rtpm.Empty` here";
    }
    return diagnostic;
  }

  [[nodiscard]] Location place_of_type(const std::string& name, const std::string& file,
                                       std::size_t line) const {
    const auto other = file == source_.path() ? std::nullopt : SourceFile::read(file);
    const SourceFile& source = other ? *other : source_;
    const std::vector<Token> tokens = tokenize(source);
    const std::string last = name.substr(name.rfind('.') + 1);
    const Token* found = nullptr;
    for (const Token& token : tokens) {
      if (!token.is_identifier() || !token.is(last)) continue;
      const std::size_t token_line = source.locate(token.span()).line;
      // The parser had read one word ahead, so its line may be one further on than the type's.
      if (line == 0 || token_line <= line) found = &token;
    }
    return found ? source.locate(found->span()) : Location{.file = file};
  }

  std::optional<Diagnostic> missing_include() const {
    auto name = after("unable to load include file: ");
    if (!name) name = after("unable to locate include file: ");
    if (!name) return std::nullopt;
    return at(tokens_[find_back(*name)].span(), "cannot find the included file \"" + *name + "\"",
              "it is searched in the folder of this file and in those given with -I");
  }

  std::optional<Diagnostic> already_exists() const {
    for (const std::string_view kind :
         {"service", "rpc", "field", "datatype", "enum", "enum value"}) {
      const auto name = after(std::string(kind) + " already exists: ");
      if (!name) continue;
      const std::string last = name->substr(name->rfind('.') + 1);
      const std::size_t second = find_definition(last, kind);
      Diagnostic diagnostic =
          at(tokens_[second].span(),
             (kind == "rpc" ? "method" : std::string(kind)) + " `" + last + "` is there twice",
             "rename or remove one of the two");
      return diagnostic;
    }
    return std::nullopt;
  }

  /// The last definition of `name` before the error: for a data type its use inside its own braces
  /// must not be taken for it.
  [[nodiscard]] std::size_t find_definition(std::string_view name, std::string_view kind) const {
    if (kind != "datatype" && kind != "enum") return find_back(name);
    for (std::size_t i = at_ + 1; i-- > 1;) {
      const bool follows_keyword = tokens_[i - 1].is("table") || tokens_[i - 1].is("struct") ||
                                   tokens_[i - 1].is("enum") || tokens_[i - 1].is("union");
      if (tokens_[i].is(name) && follows_keyword) return i;
    }
    return find_back(name);
  }

  std::optional<Diagnostic> unexpected_word() const {
    const auto rest = after("expecting: ");
    if (!rest) return std::nullopt;
    constexpr std::string_view kGot = " instead got: ";
    const std::size_t got = rest->find(kGot);
    if (got == std::string::npos) return std::nullopt;
    std::string wanted = rest->substr(0, got);
    if (wanted.size() == 1) wanted = '`' + wanted + '`';
    if (wanted == "identifier") wanted = "a name";
    const Token& token = tokens_[at_];
    const std::string found = token.kind == TokenKind::kEnd || rest->ends_with("end of file")
                                  ? "the end of the file"
                                  : '`' + std::string(token.text) + '`';
    return at(token.span(), "expected " + wanted + ", found " + found, "");
  }

  [[nodiscard]] Diagnostic as_it_is() const {
    // Many messages end with the name that they are about: point at it if it was just read.
    const std::size_t colon = error_.message.rfind(": ");
    std::size_t index = at_;
    if (colon != std::string::npos) {
      const std::size_t named = find_back(error_.message.substr(colon + 2));
      if (at_ - named <= 12) index = named;
    }
    return at(tokens_[index].span(), error_.message, "");
  }

  const RawError& error_;
  const SourceFile& source_;
  const ParsedSoFar& parsed_;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;  // The word that the parser read last.
};

}  // namespace

Diagnostic translate(const RawError& error, const SourceFile& source, const ParsedSoFar& parsed) {
  return Translation(error, source, parsed).translate();
}

}  // namespace rtpm::schema
