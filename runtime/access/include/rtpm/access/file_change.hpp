#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::access {

/// Returns the new contents of a file of grants or known servers, given the current contents.
using FileChange = std::function<expected<std::string, SetupError>(const std::string& text)>;

/// Changes a file of grants or known servers atomically: a reader sees either the old or the new
/// content. Several programs may do so concurrently. Creates a missing file with mode 0600, and its
/// folder with mode 0700; an existing file keeps its mode.
/// @realtime set-up only: waits for the disk, and up to 5 s for another program that changes it
/// @errors   those of read_trusted_file(); the error of `change`; the system's error. The file is
///           unchanged
[[nodiscard]] expected<void, SetupError> change_trusted_file(const std::string& path,
                                                             const FileChange& change);

/// Returns `text` with one more line.
[[nodiscard]] std::string with_line(std::string text, std::string_view line);
/// Returns `text` without the lines with these numbers, from 1.
[[nodiscard]] std::string without_lines(std::string_view text,
                                        const std::vector<std::size_t>& numbers);

}  // namespace rtpm::access
