#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

struct CompileRequest {
  std::string file{};  ///< A .fbs or .bfbs.
  /// Folders searched for `include`, after the file's own.
  std::vector<std::string> include_paths{};
};

/// Either a model or errors.
struct CompileResult {
  std::optional<Model> model{};
  Diagnostics errors{};
};

/// Reads a schema, checks it against RTPM's rules and returns its model with fingerprints.
/// @threads  any, concurrently
/// @realtime set-up only
/// @errors   FlatBuffers' parser stops at its first error; all breaches of RTPM's rules are
///           reported
[[nodiscard]] CompileResult compile(const CompileRequest& request);

/// Reads a binary schema, the content of a .bfbs, that another program wrote, for example into a
/// recording. It need not name the files of its declarations.
/// @param name  the file name for errors
[[nodiscard]] CompileResult compile_binary(std::span<const std::uint8_t> bytes,
                                           const std::string& name);

/// Compiles a text that another program sent. Opens no file. Refuses a text that is too large or
/// contains anything but declarations of types and services.
/// @param name   the file name for errors
/// @source       schema/README.md, "Schemas of other programs"
[[nodiscard]] CompileResult compile_text(const std::string& text, const std::string& name);

}  // namespace rtpm::schema
