#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {

/// The full path and the text of a file to write.
struct OutputFile {
  std::string path{};
  std::string text{};
};

/// Writes all of `files` or none: writes temporary files next to them, then renames these. Creates
/// missing folders.
/// @errors one sentence with cause and remedy; existing files are unchanged
[[nodiscard]] std::optional<std::string> write_all(const std::vector<OutputFile>& files);

/// The text of a dependency file for Make and Ninja: `targets` depend on `sources`.
[[nodiscard]] std::string dependency_text(const std::vector<std::string>& targets,
                                          const std::vector<std::string>& sources);

}  // namespace rtpm::schema
