#pragma once

#include <span>
#include <string>
#include <string_view>

#include "drawing.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::scene {

/// Draws panels side by side as an SVG, with axes in millimetres, a legend, and `caption` below.
/// @realtime set-up only
[[nodiscard]] std::string svg_text(std::span<const Panel> panels, std::string_view caption);

/// @realtime set-up only
/// @errors   the file can't be written
[[nodiscard]] expected<void, SetupError> write_file(const std::string& path, std::string_view svg);

}  // namespace rtpm::scene
