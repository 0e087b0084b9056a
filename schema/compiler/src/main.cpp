// rtpmc, RTPM's schema compiler.
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "command_line.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/output.hpp"

namespace rtpm::schema {
namespace {

constexpr int kSchemaError = 1;
constexpr int kUsageError = 2;

int fail(const Diagnostics& errors) {
  std::fputs(render(errors).c_str(), stderr);
  return kSchemaError;
}

int carry_out(const Command& command) {
  CompileResult result = compile({.file = command.schema, .include_paths = command.include_paths});
  if (!result.model) return fail(result.errors);
  const Model& model = *result.model;
  const auto back_end = make_cpp_back_end(RTPM_VERSION);
  if (const Diagnostics errors = back_end->check(model); !errors.empty()) return fail(errors);

  std::vector<OutputFile> files;
  std::vector<std::string> targets;
  for (GeneratedFile& file : back_end->generate(model)) {
    const auto path = std::filesystem::path(command.output_folder) / file.name;
    targets.push_back(path.string());
    files.push_back({path.string(), std::move(file.text)});
  }
  if (!command.dependency_file.empty()) {
    files.push_back({command.dependency_file, dependency_text(targets, model.source_files)});
  }
  if (const auto error = write_all(files)) {
    std::fprintf(stderr, "rtpmc: error: %s\n", error->c_str());
    return kSchemaError;
  }
  return 0;
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

}  // namespace
}  // namespace rtpm::schema

int main(int argc, char** argv) {
  const std::vector<const char*> arguments(argv + (argc > 0 ? 1 : 0), argv + argc);
  return rtpm::schema::run(arguments);
}
