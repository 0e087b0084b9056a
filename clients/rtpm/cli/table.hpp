#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtpm::tool {

using Row = std::vector<std::string>;

/// Rows of equal length as lines with columns two blanks apart: the first `left_count` flush left,
/// the others right. Texts are printable UTF-8.
[[nodiscard]] std::string aligned(const std::vector<Row>& rows, std::size_t left_count);

}  // namespace rtpm::tool
