#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace rtpm::tool {

using Json = nlohmann::ordered_json;

/// Prints a document as one line on standard output, and flushes it. Replaces invalid UTF-8.
void print_json(const Json& document);

/// Prints one or more lines, and flushes them. The caller escapes foreign parts.
void print_line(std::string_view text);

/// Whether standard output is a terminal.
[[nodiscard]] bool is_terminal();
/// Whether standard error, where progress is shown, is a terminal.
[[nodiscard]] bool is_error_terminal();
/// The width of the terminal, at least 40; 100 without a terminal.
[[nodiscard]] std::size_t terminal_width();

enum class Colour { kRed, kGreen, kYellow, kGrey, kBold };
/// `text` in a colour if the output is a terminal and NO_COLOR is not set (https://no-color.org).
[[nodiscard]] std::string coloured(std::string_view text, Colour colour);

}  // namespace rtpm::tool
