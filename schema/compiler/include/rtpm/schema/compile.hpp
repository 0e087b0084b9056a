#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// What to compile.
struct CompileRequest {
  std::string file{};  ///< The .fbs file.
  std::vector<std::string>
      include_paths{};  ///< Searched for `include`, after the file's own folder.
};

/// A model, or why there is none: exactly one of the two is there.
struct CompileResult {
  std::optional<Model> model{};
  Diagnostics errors{};
};

/// Reads a schema, checks it against RTPM's rules and gives its model with fingerprints.
/// FlatBuffers' parser stops at its first error, so that one stands alone; of RTPM's own rules,
/// every breach is reported.
/// Threads: any, one call does not know of another.   Set-up only.
[[nodiscard]] CompileResult compile(const CompileRequest& request);

/// The same of a text that is in no file, and may include none; errors name it `name`.
[[nodiscard]] CompileResult compile_text(const std::string& text, const std::string& name);

}  // namespace rtpm::schema
