#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// Either `error` or the other members are set.
struct ParseResult {
  std::vector<std::uint8_t> reflection{};   ///< A serialized reflection::Schema.
  std::string declaration_file{};           ///< The file's name in the reflection.
  std::vector<std::string> source_files{};  ///< The file and all included files.
  std::map<std::string, std::set<std::string>> included_files{};  ///< As in Model.
  std::optional<Diagnostic> error{};
};

/// Parses `source` with FlatBuffers' parser, which stops at the first error.
[[nodiscard]] ParseResult parse(const SourceFile& source, const CompileRequest& request);

/// Parses a text that another program sent. Opens no file; `declaration_file` and `source_files`
/// stay empty.
/// @param source  a text that refuse_foreign() accepts
[[nodiscard]] ParseResult parse_foreign(const SourceFile& source);

}  // namespace rtpm::schema
