#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Which number of a table is outside its field's `rtpm_range`: "force.x is 30, but must be -20 to
/// 20"; empty: none is. Vectors of unions are not looked at.
/// @param table   the index in the model of the table that `buffer` has as its root
/// @param buffer  a FlatBuffer that was verified, or made here
[[nodiscard]] std::string out_of_range(const Model& model, std::size_t table,
                                       const std::uint8_t* buffer);

}  // namespace rtpm::schema
