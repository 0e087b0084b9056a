#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "drawing.hpp"

namespace rtpm::scene {

/// Draws a panel as rows of text with Braille dots, U+2800 to U+28FF: two by four dots per
/// character. Each row is `columns` wide.
/// @param has_colour  with escape sequences of ECMA-48; a character has its uppermost line's colour
/// @realtime set-up only
[[nodiscard]] std::vector<std::string> braille_rows(const Panel& panel, std::size_t columns,
                                                    std::size_t rows, bool has_colour);

}  // namespace rtpm::scene
