#pragma once

#include <string>

namespace rtpm::console::foxglove {

/// FlatBuffers' JSON as JSON: numbers that JSON has no name for (inf, -inf, nan) become null.
[[nodiscard]] std::string strict_json(const std::string& text);

}  // namespace rtpm::console::foxglove
