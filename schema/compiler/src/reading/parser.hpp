#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// What FlatBuffers' parser made of a schema.
struct ParseResult {
  std::vector<std::uint8_t> reflection{};   ///< A serialized reflection::Schema.
  std::string declaration_file{};           ///< How the reflection names the file itself.
  std::vector<std::string> source_files{};  ///< The file and all included ones.
  std::optional<Diagnostic> error{};        ///< If there: nothing else is.
};

/// Parses `source` with FlatBuffers' own parser, in this process. It stops at the first error,
/// which is given in RTPM's words and with its exact place.
[[nodiscard]] ParseResult parse(const SourceFile& source, const CompileRequest& request);

/// A FlatBuffers error as its parser reports it.
struct RawError {
  std::size_t line = 0;         ///< From 1.
  std::size_t column_byte = 0;  ///< From 0: behind the last word that the parser read.
  std::string message{};
};

/// What the translation must ask of the failed parser.
class ParsedSoFar {
 public:
  ParsedSoFar() = default;
  ParsedSoFar(const ParsedSoFar&) = delete;
  ParsedSoFar& operator=(const ParsedSoFar&) = delete;
  virtual ~ParsedSoFar() = default;
  /// "table", "struct", "enum" or "union" for a type's name as written at the error, empty if
  /// there is none.
  [[nodiscard]] virtual std::string kind_of(const std::string& type) const = 0;
  /// The defined type that somebody who wrote `type` most likely meant, empty if none looks like
  /// it.
  [[nodiscard]] virtual std::string similar_type(const std::string& type) const = 0;
};

/// Says FlatBuffers' error in RTPM's words, points at the word that is wrong, and adds a hint.
[[nodiscard]] Diagnostic translate(const RawError& error, const SourceFile& source,
                                   const ParsedSoFar& parsed);

}  // namespace rtpm::schema
