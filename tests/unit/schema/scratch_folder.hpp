#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "rtpm/schema/compile.hpp"

namespace rtpm::schema::test {

/// A new empty folder, deleted with its content at the end.
class ScratchFolder {
 public:
  ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder();

  [[nodiscard]] std::filesystem::path path() const { return path_; }
  /// Writes the file `name` and returns its path.
  std::string write(std::string_view name, std::string_view text) const;

 private:
  std::filesystem::path path_;
};

[[nodiscard]] std::string read_file(const std::filesystem::path& path);

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
