#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

/// The operating system's side of the tool.
namespace rtpm::tool::os {

enum class Stream : std::uint8_t { kInput, kOutput, kError };
/// Whether a person is at the stream; on Windows only a console that shows colours.
[[nodiscard]] bool is_terminal(Stream stream) noexcept;
/// Writes to standard error at once. If it can't be shown, that is not a failure.
void write_error(std::string_view text) noexcept;

/// Becomes python3 with these arguments, which then reports for itself.
/// @return why not
[[nodiscard]] SetupError become_python(std::vector<std::string> arguments);

/// Ends this program after `time`, whatever it does.
void end_after(Duration time, int exit_code) noexcept;

}  // namespace rtpm::tool::os
