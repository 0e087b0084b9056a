#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {

/// A file with the whole path to write it to.
struct OutputFile {
  std::string path{};
  std::string text{};
};

/// Writes all of `files` or none: each goes to a temporary file beside its place first, and only
/// when all are complete are they renamed. Folders that lack are made.
/// Returns nothing on success, else one sentence with the cause and the remedy; files that were
/// there before are then still as they were.
[[nodiscard]] std::optional<std::string> write_all(const std::vector<OutputFile>& files);

/// The dependency file that Make and Ninja read: `targets` depend on `sources`.
[[nodiscard]] std::string dependency_text(const std::vector<std::string>& targets,
                                          const std::vector<std::string>& sources);

}  // namespace rtpm::schema
