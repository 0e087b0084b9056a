#pragma once

#include <string>
#include <string_view>
#include <system_error>

#include "rtpm/base/expected.hpp"

namespace rtpm::rt {

/// Replaces the content of the file at `path`, or creates the file. After a crash or a power
/// failure the file has either the old or the new content; once this has returned, the new one.
/// Writes `path`.new first.
/// @threads  one at a time per path
/// @realtime set-up only: waits for the disk
/// @errors   the operating system's; the old file is unchanged
[[nodiscard]] expected<void, std::error_code> replace_file(const std::string& path,
                                                           std::string_view content);

}  // namespace rtpm::rt
