#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The first number of a table that is outside its field's `rtpm_range`: "force.x is 30, but must
/// be -20 to 20"; empty if there is none. Does not examine vectors of unions.
/// @param table   the index in the model of the root table of `buffer`
/// @param buffer  a FlatBuffer that was verified, or created by this program
[[nodiscard]] std::string out_of_range(const Model& model, std::size_t table,
                                       const std::uint8_t* buffer);

}  // namespace rtpm::schema
