#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::tool {

using Row = std::vector<std::string>;

/// Formats rows of equal length as lines, with columns two blanks apart: the first `left_count`
/// columns are left-aligned, the others right-aligned. Texts are printable UTF-8.
[[nodiscard]] std::string aligned(const std::vector<Row>& rows, std::size_t left_count);

/// Wraps a text into lines of at most `width` characters, which only longer words exceed. Printable
/// UTF-8.
[[nodiscard]] std::vector<std::string> wrapped(std::string_view text, std::size_t width);

/// Wraps a text into lines of at most `width`: the first after `head`, which takes `indent`
/// characters, the others below its text.
[[nodiscard]] std::string hanging(const std::string& head, std::size_t indent,
                                  std::string_view text, std::size_t width);

}  // namespace rtpm::tool
