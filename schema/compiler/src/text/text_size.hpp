#pragma once

#include <cstddef>
#include <cstdint>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Whether the JSON of a table has at most `size_max` bytes, by an upper estimate. Parts of a
/// FlatBuffer may be shared and fields absent, so a few bytes can represent gigabytes of text.
/// @param table   the index in the model of the root table of `buffer`
/// @param buffer  a FlatBuffer that was verified
[[nodiscard]] bool has_text_of_at_most(std::size_t size_max, const Model& model, std::size_t table,
                                       const std::uint8_t* buffer);

}  // namespace rtpm::schema
