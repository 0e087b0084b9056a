#include "scratch_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

namespace rtpm::schema::test {
namespace {

/// The first lines in which the two differ.
std::string difference(const std::string& golden, const std::string& now) {
  std::istringstream golden_stream(golden);
  std::istringstream now_stream(now);
  std::string golden_line;
  std::string now_line;
  std::string text;
  int shown = 0;
  for (int line = 1; shown < 10; ++line) {
    const bool has_golden = static_cast<bool>(std::getline(golden_stream, golden_line));
    const bool has_now = static_cast<bool>(std::getline(now_stream, now_line));
    if (!has_golden && !has_now) break;
    if (has_golden && has_now && golden_line == now_line) continue;
    text += "line " + std::to_string(line) + '\n';
    if (has_golden) text += "  - " + golden_line + '\n';
    if (has_now) text += "  + " + now_line + '\n';
    ++shown;
  }
  return text;
}

}  // namespace

std::string ScratchFolder::write(std::string_view name, std::string_view text) const {
  const std::filesystem::path file = path_ / name;
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
  return file.string();
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void expect_golden(const std::filesystem::path& golden, const std::string& text) {
  if (std::getenv("RTPM_UPDATE_GOLDENS") != nullptr) {
    std::ofstream(golden, std::ios::binary) << text;
    return;
  }
  const std::string before = read_file(golden);
  EXPECT_TRUE(before == text) << golden << " (-) is not what rtpmc gives (+):\n"
                              << difference(before, text)
                              << "If the change is intended, run `RTPM_UPDATE_GOLDENS=1 "
                                 "bin/schema_test` and review the files that git shows as changed.";
}

CompileResult compile_text(std::string_view text) {
  const ScratchFolder folder;
  return compile({.file = folder.write("arm.fbs", text), .include_paths = {RTPM_IDL_FOLDER}});
}

Model model_of(std::string_view text) {
  CompileResult result = compile_text(text);
  EXPECT_EQ(render(result.errors), "");
  return result.model ? *std::move(result.model) : Model{};
}

std::string errors_of(std::string_view text) {
  Diagnostics errors = compile_text(text).errors;
  for (Diagnostic& error : errors)
    error.location.file = "arm.fbs";
  return render(std::move(errors));
}

std::string replaced(std::string_view text, std::string_view what, std::string_view instead) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string_view::npos) << what;
  return std::string(text).replace(std::min(at, text.size()), what.size(), instead);
}

}  // namespace rtpm::schema::test
