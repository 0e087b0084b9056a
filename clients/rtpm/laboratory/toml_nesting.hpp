#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "laboratory/document.hpp"

namespace rtpm::laboratory {

/// Where a TOML text nests deeper than `nesting_max`: the parts of a table's name, the parts of
/// dotted keys, lists and inline tables together. The parser, and what copies and destroys its
/// tables, recurse that deep.
/// @return nothing: nowhere; a text that is no TOML may give either
/// @realtime alloc-free but for a table of `nesting_max` numbers
[[nodiscard]] std::optional<Position> toml_nested_beyond(std::string_view text,
                                                         std::size_t nesting_max);

}  // namespace rtpm::laboratory
