#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "laboratory/document.hpp"

namespace rtpm::laboratory {

/// The position where a TOML text nests deeper than `nesting_max`: the parts of a table's name, the
/// parts of dotted keys, lists and inline tables together. The parser, and the code that copies and
/// destroys its tables, recurse that deep.
/// @return nullopt if it does not; for invalid TOML either result is possible
/// @realtime alloc-free except for a table of `nesting_max` numbers
[[nodiscard]] std::optional<Position> toml_nested_beyond(std::string_view text,
                                                         std::size_t nesting_max);

}  // namespace rtpm::laboratory
