// rtpmc, RTPM's schema compiler.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "cpp/object_split.hpp"
#include "program/command_line.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/conform.hpp"
#include "rtpm/schema/output.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {
namespace {

constexpr int kSchemaError = 1;
constexpr int kUsageError = 2;

int fail(const Diagnostics& errors) {
  std::fputs(render(errors).c_str(), stderr);
  return kSchemaError;
}

/// Reports the differences between `model` and the older schema.
/// @return whether programs built from the two work together
bool conforms(const Command& command, const Model& model, const Model& older) {
  const std::vector<Change> changes = compare(older, model);
  bool is_good = true;
  for (const Change& change : changes) {
    is_good &= change.verdict == Verdict::kCompatible ||
               (change.verdict == Verdict::kServersFirst && !command.is_strict);
  }
  std::fputs(render(changes).c_str(), stderr);
  return is_good;
}

int write(const Command& command, const Model& model) {
  std::vector<OutputFile> files;
  std::vector<std::string> targets;
  for (const BackEndEntry& entry : back_ends()) {
    const auto& chosen = command.languages;
    if (std::find(chosen.begin(), chosen.end(), entry.name) == chosen.end()) continue;
    const auto back_end = entry.make(RTPM_VERSION);
    if (const Diagnostics errors = back_end->check(model); !errors.empty()) return fail(errors);
    for (GeneratedFile& file : back_end->generate(model)) {
      if (command.output_folder.empty()) {
        std::fputs(file.text.c_str(), stdout);
        return 0;
      }
      const auto path = std::filesystem::path(command.output_folder) / file.name;
      targets.push_back(path.string());
      files.push_back({path.string(), std::move(file.text)});
    }
  }
  if (!command.dependency_file.empty()) {
    std::vector<std::string> sources = model.source_files;
    if (!command.conform.empty()) sources.push_back(command.conform);
    files.push_back({command.dependency_file, dependency_text(targets, sources)});
  }
  if (const auto error = write_all(files)) {
    std::fprintf(stderr, "rtpmc: error: %s\n", error->c_str());
    return kSchemaError;
  }
  return 0;
}

/// Runs the checks of all languages, so that code for any of them can be generated from every
/// accepted schema. Stops at the first language with errors: the next often has the same ones.
Diagnostics check(const Model& model) {
  for (const BackEndEntry& entry : back_ends()) {
    if (Diagnostics errors = entry.make(RTPM_VERSION)->check(model); !errors.empty()) return errors;
  }
  return {};
}

int carry_out(const Command& command) {
  std::vector<std::string> include_paths = command.include_paths;
  // RTPM's own schemas come last, so that a project can use its own copy.
  if (std::string own = idl_folder(); !own.empty()) include_paths.push_back(std::move(own));
  const CompileResult result = compile({.file = command.schema, .include_paths = include_paths});
  if (!result.model) return fail(result.errors);
  if (command.is_check) {
    if (const Diagnostics errors = check(*result.model); !errors.empty()) return fail(errors);
  }
  if (!command.conform.empty()) {
    const CompileResult older = compile({.file = command.conform, .include_paths = include_paths});
    if (!older.model) return fail(older.errors);
    if (!conforms(command, *result.model, *older.model)) return kSchemaError;
  }
  return command.is_check ? 0 : write(command, *result.model);
}

int run(std::span<const char* const> arguments) {
  const auto parsed = read_command_line(arguments, RTPM_VERSION);
  if (const auto* error = std::get_if<UsageError>(&parsed)) {
    std::fprintf(stderr, "rtpmc: error: %s\n", error->text.c_str());
    return kUsageError;
  }
  if (const auto* answer = std::get_if<Answer>(&parsed)) {
    std::fputs(answer->text.c_str(), stdout);
    return 0;
  }
  return carry_out(std::get<Command>(parsed));
}

/// `rtpmc split-objects HEADER SOURCE`, for rtpm_generate(): see split_objects().
int split(const std::string& header, const std::string& source) {
  const auto file = SourceFile::read(header);
  if (!file) {
    std::fprintf(stderr, "rtpmc: error: cannot read \"%s\"\n", header.c_str());
    return kSchemaError;
  }
  const SplitHeader parts =
      split_objects(file->text(), std::filesystem::path(header).filename().string());
  if (const auto error = write_all({{header, parts.header}, {source, parts.source}})) {
    std::fprintf(stderr, "rtpmc: error: %s\n", error->c_str());
    return kSchemaError;
  }
  return 0;
}

}  // namespace
}  // namespace rtpm::schema

int main(int argc, char** argv) {
  const std::vector<const char*> arguments(argv + (argc > 0 ? 1 : 0), argv + argc);
  if (arguments.size() == 3 && std::string_view(arguments[0]) == "split-objects") {
    return rtpm::schema::split(arguments[1], arguments[2]);
  }
  return rtpm::schema::run(arguments);
}
