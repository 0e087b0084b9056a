#include "rtpm/schema/compile.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>

#include "checker.hpp"
#include "outline.hpp"
#include "parser.hpp"
#include "reflection.hpp"
#include "rtpm/schema/fingerprint.hpp"

namespace rtpm::schema {
namespace {

CompileResult failure(Diagnostic error) {
  CompileResult result;
  result.errors.push_back(std::move(error));
  return result;
}

CompileResult failure(const std::string& file, std::string message, std::string hint) {
  return failure({Location{.file = file}, std::move(message), std::move(hint), std::nullopt});
}

/// Reads the file itself; included files are read by FlatBuffers' parser.
std::optional<SourceFile> read(const std::string& file, CompileResult& failed) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    failed = failure(file, "is a folder, not a schema", "name the .fbs file in it");
    return std::nullopt;
  }
  auto source = SourceFile::read(file);
  if (!source) {
    failed = failure(file, std::string("cannot read the schema: ") + std::strerror(errno),
                     "check the path and the right to read it");
    return std::nullopt;
  }
  // FlatBuffers' parser ends at a zero byte and would silently leave out the rest.
  if (const std::size_t zero = source->text().find('\0'); zero != std::string::npos) {
    Location location = source->locate({zero, 1});
    location.line_text.clear();
    failed = failure({std::move(location), "a zero byte: this is not a text file",
                      "store the schema as UTF-8 text", std::nullopt});
    return std::nullopt;
  }
  return source;
}

}  // namespace

CompileResult compile(const CompileRequest& request) {
  CompileResult result;
  const auto source = read(request.file, result);
  if (!source) return result;
  ParseResult parsed = parse(*source, request);
  if (parsed.error) return failure(*std::move(parsed.error));
  auto model = read_reflection(parsed.reflection, parsed.declaration_file);
  if (!model) {
    return failure(request.file, "FlatBuffers' parser gave a reflection that cannot be read",
                   "rtpmc and the FlatBuffers library that it uses are of different versions: "
                   "build rtpmc again");
  }
  model->file = request.file;
  model->file_stem = std::filesystem::path(request.file).stem().string();
  model->source_files = std::move(parsed.source_files);
  result.errors = check(*model, *source, outline(*source));
  if (!result.errors.empty()) return result;
  set_fingerprints(*model);
  result.model = std::move(model);
  return result;
}

}  // namespace rtpm::schema
