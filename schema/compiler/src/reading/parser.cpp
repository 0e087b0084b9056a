#include "reading/parser.hpp"

#include <flatbuffers/idl.h>
#include <flatbuffers/util.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "reading/closed_parser.hpp"
#include "reading/parser_error.hpp"
#include "reading/tokens.hpp"

namespace rtpm::schema {
namespace {

flatbuffers::IDLOptions parser_options() {
  flatbuffers::IDLOptions options;
  options.binary_schema_comments = true;
  options.binary_schema_builtins = true;
  // With this root, the reflection contains the absolute path of each declaration's file.
  options.project_root = "/";
  // The language determines which features the parser accepts; flatc --cpp uses the same.
  options.lang_to_generate = flatbuffers::IDLOptions::kCpp;
  // flatc prints the same warnings when it generates the data types.
  options.no_warnings = true;
  return options;
}

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

/// The position of the `include` of `file`.
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
      Diagnostic diagnostic = diagnostic_of(error, *included, parser);
      if (!diagnostic.note) diagnostic.note = place_of_include(parser, file);
      return diagnostic;
    }
  }
  return diagnostic_of(error, main_source, parser);
}

/// The parser's reflection. That has defaults as signed numbers, and would have 0 for one that is
/// larger; the model takes the same bits for an unsigned number.
std::vector<std::uint8_t> serialized(flatbuffers::Parser& parser) {
  for (const flatbuffers::StructDef* type : parser.structs_.vec) {
    for (flatbuffers::FieldDef* field : type->fields.vec) {
      std::string& number = field->value.constant;
      std::uint64_t value = 0;
      if (field->value.type.base_type != flatbuffers::BASE_TYPE_ULONG) continue;
      const auto [end, error] =
          std::from_chars(number.data(), number.data() + number.size(), value);
      if (error == std::errc{} && end == number.data() + number.size()) {
        number = std::to_string(static_cast<std::int64_t>(value));
      }
    }
  }
  parser.Serialize();
  const std::uint8_t* bytes = parser.builder_.GetBufferPointer();
  return {bytes, bytes + parser.builder_.GetSize()};
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
  result.reflection = serialized(*parser);
  const auto declaration_file = [&](const std::string& path) {
    return flatbuffers::RelativeToRootPath(parser->opts.project_root, path);
  };
  result.declaration_file = declaration_file(source.path());
  result.source_files.push_back(source.path());
  for (const std::string& file : parser->GetIncludedFilesRecursive(source.path())) {
    if (file != source.path()) result.source_files.push_back(file);
  }
  for (const std::string& file : result.source_files) {
    for (const std::string& included : parser->GetIncludedFilesRecursive(file))
      result.included_files[declaration_file(file)].insert(declaration_file(included));
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
  result.reflection = serialized(*parser);
  return result;
}

}  // namespace rtpm::schema
