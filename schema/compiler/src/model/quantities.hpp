#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The units, ranges and frames of a payload, one line per field that has any: "request.force.x:
/// newton, -20 to 20, in the frame base".
/// @param role  "request" or "reply"
[[nodiscard]] Documentation quantities(const Model& model, const Payload& payload,
                                       const std::string& role);

/// The quantity of one field: "newton, -20 to 20, in the frame base"; empty if it has none.
[[nodiscard]] std::string quantity(const Field& field);

}  // namespace rtpm::schema
