#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// Either `error` or the other members are set.
struct ParseResult {
  std::vector<std::uint8_t> reflection{};   ///< A serialized reflection::Schema.
  std::string declaration_file{};           ///< The file's name in the reflection.
  std::vector<std::string> source_files{};  ///< The file and all included ones.
  std::optional<Diagnostic> error{};
};

/// Parses `source` with FlatBuffers' parser, which stops at the first error.
[[nodiscard]] ParseResult parse(const SourceFile& source, const CompileRequest& request);

/// As parse(), of a text that another program sent. It opens no file; `declaration_file` and
/// `source_files` stay empty.
/// @param source  refuse_foreign() accepts it
[[nodiscard]] ParseResult parse_foreign(const SourceFile& source);

/// A FlatBuffers error as its parser reports it.
struct RawError {
  std::size_t line = 0;         ///< From 1.
  std::size_t column_byte = 0;  ///< From 0: after the last token that the parser read.
  std::string message{};
};

/// The types that the failed parser knows.
class ParsedSoFar {
 public:
  ParsedSoFar() = default;
  ParsedSoFar(const ParsedSoFar&) = delete;
  ParsedSoFar& operator=(const ParsedSoFar&) = delete;
  virtual ~ParsedSoFar() = default;
  /// "table", "struct", "enum" or "union"; empty if there is no such type.
  /// @param type  its name as written at the error
  [[nodiscard]] virtual std::string kind_of(const std::string& type) const = 0;
  /// The defined type with the most similar name; empty if none is similar.
  [[nodiscard]] virtual std::string similar_type(const std::string& type) const = 0;
};

/// FlatBuffers' error in RTPM's words, at the wrong token, with a hint; an unknown message as it
/// is.
[[nodiscard]] Diagnostic translate(const RawError& error, const SourceFile& source,
                                   const ParsedSoFar& parsed);

}  // namespace rtpm::schema
