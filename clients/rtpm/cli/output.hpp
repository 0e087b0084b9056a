#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace rtpm::tool {

using Json = nlohmann::ordered_json;

/// Prints a document as one line of standard output, and flushes it. Bytes that are no UTF-8 are
/// replaced.
void print_json(const Json& document);

/// Prints a line, or several, and flushes them. Foreign parts are escaped beforehand.
void print_line(std::string_view text);

/// Whether people look at standard output.
[[nodiscard]] bool is_terminal();
/// Whether people look at standard error, where progress goes.
[[nodiscard]] bool is_error_terminal();
/// Columns of the terminal, 100 where people do not look, never fewer than 40.
[[nodiscard]] std::size_t terminal_width();

enum class Colour { kRed, kGreen, kYellow, kGrey, kBold };
/// `text` in a colour if people look at it, and NO_COLOR is not set (https://no-color.org).
[[nodiscard]] std::string coloured(std::string_view text, Colour colour);

}  // namespace rtpm::tool
