#pragma once

#include <string>

namespace rtpm::console::foxglove {

/// Turns FlatBuffers' JSON into strict JSON: numbers without a JSON form (inf, -inf, nan) become
/// null.
[[nodiscard]] std::string strict_json(const std::string& text);

}  // namespace rtpm::console::foxglove
