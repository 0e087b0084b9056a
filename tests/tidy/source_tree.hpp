#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::tidy {

/// One file of the tree.
struct SourceFile {
  std::string path;  ///< From the tree's root, with '/': "runtime/rt/src/clock.cpp".
  std::string text;
};

/// A breach of a rule, as a compiler would print it: "path:line: what is wrong, and the remedy".
using Fault = std::string;

/// Every text file that people wrote: the source folders and the files at the root, without the
/// files that builds and version control leave there.
[[nodiscard]] std::vector<SourceFile> read_tree(const std::filesystem::path& root);

/// The lines of `text`, without their ends.
[[nodiscard]] std::vector<std::string> lines_of(std::string_view text);

/// `text` with comments and the content of string and character literals blanked out, line by line,
/// so that a search finds code only.
[[nodiscard]] std::string code_of(std::string_view text);

[[nodiscard]] bool is_cpp(const SourceFile& file);

[[nodiscard]] Fault fault_at(const SourceFile& file, std::size_t line_index, std::string_view text);

}  // namespace rtpm::tidy
