#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::tool {

using Row = std::vector<std::string>;

/// Rows of equal length as lines with columns two blanks apart: the first `left_count` columns
/// flush left, the rest flush right. Texts are printable UTF-8.
[[nodiscard]] std::string aligned(const std::vector<Row>& rows, std::size_t left_count);

/// The words of a text in lines of at most `width` characters; only a longer word exceeds it.
/// Printable UTF-8.
[[nodiscard]] std::vector<std::string> wrapped(std::string_view text, std::size_t width);

}  // namespace rtpm::tool
