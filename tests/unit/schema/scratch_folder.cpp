#include "scratch_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

namespace rtpm::schema::test {

ScratchFolder::ScratchFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "rtpm schema XXXXXX").string();
  EXPECT_NE(::mkdtemp(name.data()), nullptr);
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

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
