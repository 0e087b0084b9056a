#include "rtpm/schema/compile.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "checks/checker.hpp"
#include "reading/foreign_text.hpp"
#include "reading/outline.hpp"
#include "reading/parser.hpp"
#include "reading/reflection.hpp"
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

// A larger file is not a schema.
constexpr std::size_t kSchemaSizeMax = 16 * 1024 * 1024;

/// Reads the file itself; FlatBuffers' parser reads included files.
std::optional<SourceFile> read(const std::string& file, CompileResult& failed) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    failed = failure(file, "is a folder, not a schema", "name the .fbs file in it");
    return std::nullopt;
  }
  auto source = SourceFile::read(file);
  if (!source) {
    failed = failure(file, std::string("cannot read the schema: ") + std::strerror(errno),
                     "check the path and the permission to read it");
    return std::nullopt;
  }
  if (source->text().size() > kSchemaSizeMax) {
    failed = failure(file, "the schema is larger than 16 MiB", "split it and include the parts");
    return std::nullopt;
  }
  return source;
}

bool is_text(const SourceFile& source, CompileResult& failed) {
  // FlatBuffers' parser stops at a zero byte and silently ignores the rest.
  const std::size_t zero = source.text().find('\0');
  if (zero == std::string::npos) return true;
  Location location = source.locate({zero, 1});
  location.line_text.clear();
  failed = failure({std::move(location), "a zero byte: this is not a text file",
                    "store the schema as UTF-8 text", std::nullopt});
  return false;
}

bool is_binary_schema(const std::string& file) {
  return std::filesystem::path(file).extension() == ".bfbs";
}

/// The model of a .fbs, from the reflection that FlatBuffers' parser creates.
std::optional<Model> read_text(const SourceFile& source, const CompileRequest& request,
                               std::deque<SchemaText>& texts, CompileResult& failed) {
  if (!is_text(source, failed)) return std::nullopt;
  ParseResult parsed = parse(source, request);
  if (parsed.error) {
    failed = failure(*std::move(parsed.error));
    return std::nullopt;
  }
  auto model = read_reflection(parsed.reflection, parsed.declaration_file);
  if (!model) {
    failed = failure(request.file, "the schema uses a type of FlatBuffers that rtpmc does not know",
                     "use a newer rtpmc, or do without the type");
    return std::nullopt;
  }
  model->source_files = std::move(parsed.source_files);
  model->included_files = std::move(parsed.included_files);
  texts.emplace_back(source);
  for (const std::string& included : model->source_files) {
    if (included == source.path()) continue;
    if (auto text = SourceFile::read(included)) texts.emplace_back(*std::move(text));
  }
  return model;
}

/// The model of a .bfbs, which has no locations.
std::optional<Model> read_binary(const SourceFile& source, std::deque<SchemaText>& texts,
                                 CompileResult& failed) {
  const std::string& bytes = source.text();
  const std::span<const std::uint8_t> reflection(
      static_cast<const std::uint8_t*>(static_cast<const void*>(bytes.data())), bytes.size());
  auto model = read_reflection(reflection);
  constexpr const char* kHint =
      "make it with `flatc -b --schema --bfbs-comments --bfbs-builtins --bfbs-filenames DIR`, or "
      "give rtpmc the .fbs file";
  if (!model) {
    failed = failure(source.path(), "is not a binary schema, or one of another version", kHint);
    return std::nullopt;
  }
  if (model->declaration_file.empty()) {
    failed = failure(source.path(), "does not say which file declares what", kHint);
    return std::nullopt;
  }
  model->source_files.push_back(source.path());
  texts.emplace_back(source.path(), *model);
  return model;
}

/// Whether both readers of a text found the same services, which check() relies on.
bool has_services_of(const Outline& outline, const Model& model) {
  std::map<std::string, std::size_t> method_counts;
  for (const ServiceOutline& service : outline.services)
    method_counts.emplace(service.name, service.methods.size());
  return outline.services.size() == model.services.size() &&
         std::ranges::all_of(model.services, [&](const Service& service) {
           const auto found = method_counts.find(service.name);
           return found != method_counts.end() && found->second == service.methods.size();
         });
}

CompileResult complete(Model model, const std::deque<SchemaText>& texts, const std::string& file) {
  CompileResult result;
  model.file = file;
  model.file_stem = std::filesystem::path(file).stem().string();
  result.errors = check(model, texts);
  if (!result.errors.empty()) return result;
  set_fingerprints(model);
  result.model = std::move(model);
  return result;
}

}  // namespace

CompileResult compile(const CompileRequest& request) {
  CompileResult result;
  const auto source = read(request.file, result);
  if (!source) return result;
  std::deque<SchemaText> texts;
  auto model = is_binary_schema(request.file) ? read_binary(*source, texts, result)
                                              : read_text(*source, request, texts, result);
  return model ? complete(*std::move(model), texts, request.file) : result;
}

CompileResult compile_binary(std::span<const std::uint8_t> bytes, const std::string& name) {
  constexpr const char* kWhat = "is not a binary schema, or one of another version";
  if (bytes.size() > kSchemaSizeMax) return failure(name, kWhat, "");
  auto model = read_reflection(bytes);
  if (!model) return failure(name, kWhat, "");
  model->source_files.push_back(name);
  std::deque<SchemaText> texts;
  texts.emplace_back(name, *model);
  return complete(*std::move(model), texts, name);
}

CompileResult compile_text(const std::string& text, const std::string& name) {
  const SourceFile source(name, text);
  if (auto refusal = refuse_foreign(source)) return failure(*std::move(refusal));
  ParseResult parsed = parse_foreign(source);
  if (parsed.error) return failure(*std::move(parsed.error));
  std::deque<SchemaText> texts;
  texts.emplace_back(source);
  auto model = read_reflection(parsed.reflection);
  if (!model || !has_services_of(texts.front().outline(), *model)) {
    return failure(name, "the schema uses what this version does not know", "use a newer version");
  }
  model->source_files.push_back(name);
  return complete(*std::move(model), texts, name);
}

}  // namespace rtpm::schema
