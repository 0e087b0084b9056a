#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "rtpm/schema/compile.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::schema::test {

using rtpm::test::expect_text;

/// A new empty folder with a blank in its path, deleted with its content at the end.
class ScratchFolder {
 public:
  ScratchFolder() { std::filesystem::create_directory(path_); }
  [[nodiscard]] std::filesystem::path path() const { return path_; }
  /// Writes the file `name` and returns its path.
  std::string write(std::string_view name, std::string_view text) const;

 private:
  rtpm::test::TemporaryFolder parent_;
  std::filesystem::path path_ = parent_.file("a schema");
};

[[nodiscard]] std::string read_file(const std::filesystem::path& path);

/// Compares `text` with the reviewed file `golden`, or writes that if RTPM_UPDATE_GOLDENS is set.
void expect_golden(const std::filesystem::path& golden, const std::string& text);

/// Compiles `text` as the schema arm.fbs, which may include RTPM's own schemas.
[[nodiscard]] CompileResult compile_text(std::string_view text);
/// The model of `text`; the test fails if there is none.
[[nodiscard]] Model model_of(std::string_view text);
/// The rendered errors of `text`, without the folder before "arm.fbs".
[[nodiscard]] std::string errors_of(std::string_view text);
/// `text` with the first `what` replaced; the test fails if there is none.
[[nodiscard]] std::string replaced(std::string_view text, std::string_view what,
                                   std::string_view instead);

}  // namespace rtpm::schema::test
