#include "reading/parser.hpp"

#include <flatbuffers/idl.h>
#include <flatbuffers/util.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "checks/words.hpp"
#include "reading/closed_parser.hpp"
#include "reading/tokens.hpp"

namespace rtpm::schema {
namespace {

flatbuffers::IDLOptions parser_options() {
  flatbuffers::IDLOptions options;
  options.binary_schema_comments = true;
  options.binary_schema_builtins = true;
  // With a root the reflection has each declaration's file; with this one, by absolute path.
  options.project_root = "/";
  // The language decides which features the parser accepts: the same as flatc --cpp.
  options.lang_to_generate = flatbuffers::IDLOptions::kCpp;
  // flatc prints the same warnings when it generates the data types.
  options.no_warnings = true;
  return options;
}

std::string qualified(const std::string& scope, const std::string& name) {
  return scope.empty() ? name : scope + '.' + name;
}

constexpr std::string_view kScalarNames[] = {
    "bool",   "byte",   "ubyte", "short", "ushort", "int",    "uint",  "long",   "ulong", "float",
    "double", "string", "int8",  "uint8", "int16",  "uint16", "int32", "uint32", "int64", "uint64"};

class FailedParser final : public ParsedSoFar {
 public:
  explicit FailedParser(const flatbuffers::Parser& parser) : parser_(parser) {}

  [[nodiscard]] std::string kind_of(const std::string& type) const override {
    // As the parser, search the namespace at the error, then outwards.
    std::string scope;
    if (parser_.current_namespace_ != nullptr) {
      scope = parser_.current_namespace_->GetFullyQualifiedName("");
    }
    while (true) {
      const std::string name = qualified(scope, type);
      if (const auto* object = parser_.structs_.Lookup(name); object && !object->predecl) {
        return object->fixed ? "struct" : "table";
      }
      if (const auto* enumeration = parser_.enums_.Lookup(name)) {
        return enumeration->is_union ? "union" : "enum";
      }
      if (scope.empty()) return {};
      const std::size_t dot = scope.rfind('.');
      scope.resize(dot == std::string::npos ? 0 : dot);
    }
  }

  [[nodiscard]] std::string similar_type(const std::string& type) const override {
    // By the last component: a wrong namespace is a mistake, too.
    std::vector<std::string_view> names(std::begin(kScalarNames), std::end(kScalarNames));
    std::map<std::string, std::string, std::less<>> written;
    for (const auto* object : parser_.structs_.vec) {
      if (!object->predecl) written.emplace(object->name, as_written_here(*object));
    }
    for (const auto* enumeration : parser_.enums_.vec)
      written.emplace(enumeration->name, as_written_here(*enumeration));
    const std::string last = short_name(type);
    if (const auto same = written.find(last); same != written.end()) return same->second;
    for (const auto& [name, text] : written)
      names.push_back(name);
    const std::string similar = most_similar(last, names);
    const auto found = written.find(similar);
    return found == written.end() ? similar : found->second;
  }

 private:
  /// A type's name as the text must have it at the error.
  [[nodiscard]] std::string as_written_here(const flatbuffers::Definition& type) const {
    if (type.defined_namespace == nullptr || type.defined_namespace == parser_.current_namespace_) {
      return type.name;
    }
    return type.defined_namespace->GetFullyQualifiedName(type.name);
  }

  const flatbuffers::Parser& parser_;
};

std::size_t take_number(std::string_view& text) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc{}) text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

/// Parses "<absolute path>:<line>: <column>: error: <message>".
RawError take_apart(const flatbuffers::Parser& parser) {
  std::string_view text = parser.error_;
  const std::string path = flatbuffers::AbsolutePath(parser.file_being_parsed_) + ':';
  if (text.starts_with(path)) text.remove_prefix(path.size());
  RawError error;
  error.line = take_number(text);
  text.remove_prefix(std::min<std::size_t>(2, text.size()));
  error.column_byte = take_number(text);
  constexpr std::string_view kLead = ": error: ";
  if (text.starts_with(kLead)) text.remove_prefix(kLead.size());
  error.message = text;
  return error;
}

/// Where `file` was included.
std::optional<Note> place_of_include(const flatbuffers::Parser& parser, const std::string& file) {
  for (const auto& [includer, included_files] : parser.files_included_per_file_) {
    for (const flatbuffers::IncludedFile& included : included_files) {
      if (included.filename != file) continue;
      const auto source = SourceFile::read(includer);
      if (!source) return std::nullopt;
      for (const Token& token : tokenize(*source)) {
        if (token.kind == TokenKind::kString && token.value() == included.schema_name) {
          return Note{source->locate(token.span()), "it is included here"};
        }
      }
    }
  }
  return std::nullopt;
}

Diagnostic describe_failure(const flatbuffers::Parser& parser, const SourceFile& main_source) {
  const RawError error = take_apart(parser);
  const std::string& file = parser.file_being_parsed_;
  if (!file.empty() && file != main_source.path()) {
    if (const auto included = SourceFile::read(file)) {
      Diagnostic diagnostic = translate(error, *included, FailedParser(parser));
      if (!diagnostic.note) diagnostic.note = place_of_include(parser, file);
      return diagnostic;
    }
  }
  return translate(error, main_source, FailedParser(parser));
}

}  // namespace

ParseResult parse(const SourceFile& source, const CompileRequest& request) {
  std::vector<const char*> include_paths;
  for (const std::string& path : request.include_paths)
    include_paths.push_back(path.c_str());
  include_paths.push_back(nullptr);

  const auto parser = std::make_unique<flatbuffers::Parser>(parser_options());
  ParseResult result;
  if (!parser->Parse(source.text().c_str(), include_paths.data(), source.path().c_str())) {
    result.error = describe_failure(*parser, source);
    return result;
  }
  parser->Serialize();
  const std::uint8_t* bytes = parser->builder_.GetBufferPointer();
  result.reflection.assign(bytes, bytes + parser->builder_.GetSize());
  result.declaration_file =
      flatbuffers::RelativeToRootPath(parser->opts.project_root, source.path());
  result.source_files.push_back(source.path());
  for (const std::string& file : parser->GetIncludedFilesRecursive(source.path())) {
    if (file != source.path()) result.source_files.push_back(file);
  }
  return result;
}

ParseResult parse_foreign(const SourceFile& source) {
  flatbuffers::IDLOptions options = parser_options();
  options.project_root.clear();
  const auto parser = std::make_unique<flatbuffers::Parser>(options);
  ParseResult result;
  if (!parse_closed(*parser, source.text().c_str())) {
    result.error = describe_failure(*parser, source);
    return result;
  }
  parser->Serialize();
  const std::uint8_t* bytes = parser->builder_.GetBufferPointer();
  result.reflection.assign(bytes, bytes + parser->builder_.GetSize());
  return result;
}

}  // namespace rtpm::schema
