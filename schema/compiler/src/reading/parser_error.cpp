#include "reading/parser_error.hpp"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/attributes.hpp"
#include "model/words.hpp"
#include "reading/tokens.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {
namespace {

/// The most tokens that may lie between an error and the subject before it.
constexpr std::size_t kSubjectDistanceMax = 12;

constexpr std::string_view kScalarNames[] = {
    "bool",   "byte",   "ubyte", "short", "ushort", "int",    "uint",  "long",   "ulong", "float",
    "double", "string", "int8",  "uint8", "int16",  "uint16", "int32", "uint32", "int64", "uint64"};

/// A type's name as it must be written at the error's position.
std::string as_written_here(const flatbuffers::Parser& parser,
                            const flatbuffers::Definition& type) {
  if (type.defined_namespace == nullptr || type.defined_namespace == parser.current_namespace_) {
    return type.name;
  }
  return type.defined_namespace->GetFullyQualifiedName(type.name);
}

/// The type with the most similar name, including a wrong namespace; empty if none is similar.
std::string similar_type(const flatbuffers::Parser& parser, const std::string& type) {
  std::vector<std::string_view> names(std::begin(kScalarNames), std::end(kScalarNames));
  std::map<std::string, std::string, std::less<>> written;
  for (const auto* object : parser.structs_.vec) {
    if (!object->predecl) written.emplace(object->name, as_written_here(parser, *object));
  }
  for (const auto* enumeration : parser.enums_.vec)
    written.emplace(enumeration->name, as_written_here(parser, *enumeration));
  const std::string last = short_name(type);
  if (const auto same = written.find(last); same != written.end()) return same->second;
  for (const auto& [name, text] : written)
    names.push_back(name);
  const std::string similar = most_similar(last, names);
  const auto found = written.find(similar);
  return found == written.end() ? similar : found->second;
}

/// The part of `message` after `prefix`; nullopt if it starts differently.
std::optional<std::string> after(std::string_view prefix, const std::string& message) {
  if (!message.starts_with(prefix)) return std::nullopt;
  return message.substr(prefix.size());
}

/// The subject of a message, in quotes or at its end; empty if there is none.
std::string subject_of(const std::string& message) {
  if (const std::size_t quote = message.find('"'); quote != std::string::npos) {
    return message.substr(quote + 1, message.find('"', quote + 1) - quote - 1);
  }
  const std::size_t colon = message.rfind(": ");
  return colon == std::string::npos ? std::string{} : message.substr(colon + 2);
}

/// The position of `subject` if it was read just before the error; otherwise that of the error's
/// token.
Location place_of(const RawError& error, const SourceFile& source, const std::string& subject) {
  const std::vector<Token> tokens = tokenize(source);
  const std::size_t cursor = source.offset_of(error.line, error.column_byte);
  std::size_t at = 0;
  while (at + 1 < tokens.size() && tokens[at + 1].offset < cursor)
    ++at;
  const std::size_t first = at - std::min(at, kSubjectDistanceMax);
  for (std::size_t i = at + 1; i-- > first;) {
    if (tokens[i].value() == subject) return source.locate(tokens[i].span());
  }
  return source.locate(tokens[at].span());
}

/// The use of the type `name` on `line` of `source`, or the last one before: the parser reads a
/// token ahead, so it may be on a later line.
std::optional<Location> use_of_type(const std::string& name, const SourceFile& source,
                                    std::size_t line) {
  std::optional<Location> found;
  const std::string first_part = name.substr(0, name.find('.'));
  for (const Token& token : tokenize(source)) {
    if (!token.is(first_part) ||
        !std::string_view(source.text()).substr(token.offset).starts_with(name)) {
      continue;
    }
    const Location location = source.locate({token.offset, name.size()});
    if (location.line > line) break;
    if (!found || location.line != found->line) found = location;
  }
  return found;
}

/// `rest` is "TYPE, originally at: FILE:LINE". The parser reports this only after it has read all
/// files.
Diagnostic undefined_type(const std::string& rest, const SourceFile& source,
                          const flatbuffers::Parser& parser) {
  constexpr std::string_view kOrigin = ", originally at: ";
  const std::size_t origin = rest.find(kOrigin);
  const std::string name = rest.substr(0, origin);
  Location location{.file = source.path()};
  if (origin != std::string::npos) {
    const std::string place = rest.substr(origin + kOrigin.size());
    const std::size_t colon = std::min(place.rfind(':'), place.size());
    const std::string file = place.substr(0, colon);
    const std::size_t line =
        std::strtoul(place.c_str() + colon + (colon < place.size() ? 1 : 0), nullptr, 10);
    const bool is_here = file.empty() || file == source.path();
    const auto other = is_here ? std::nullopt : SourceFile::read(file);
    if (!is_here) location.file = file;
    location = use_of_type(name, other ? *other : source, line).value_or(location);
  }
  const std::string similar = similar_type(parser, name);
  std::string hint;
  if (similar == name) {
    hint = "define it above its first use";
  } else if (!similar.empty()) {
    hint = "did you mean `" + similar + "`?";
  }
  return {location, "type referenced but not defined (check namespace): " + name, hint,
          std::nullopt};
}

/// Advice about RTPM's own rules; empty if there is none.
std::string hint_for(const std::string& message) {
  if (const auto name = after("user define attributes must be declared before use: ", message)) {
    return is_known_attribute(*name)
               ? "write `include \"rtpm.fbs\";` at the top: it declares RTPM's attributes"
               : unknown_attribute_hint(*name);
  }
  if (after("rpc request and response types must be tables", message)) {
    return "wrap it: `table ForceMessage { force:Force (required); }` is the bare struct on the "
           "wire; write rtpm.Empty for no content";
  }
  if (after("unable to load include file: ", message) ||
      after("unable to locate include file: ", message)) {
    return "it is searched in the folder of this file and in those given with -I";
  }
  return {};
}

}  // namespace

Diagnostic diagnostic_of(const RawError& error, const SourceFile& source,
                         const flatbuffers::Parser& parser) {
  const std::string& message = error.message;
  if (const auto rest = after("type referenced but not defined (check namespace): ", message)) {
    return undefined_type(*rest, source, parser);
  }
  return {place_of(error, source, subject_of(message)), message, hint_for(message), std::nullopt};
}

}  // namespace rtpm::schema
