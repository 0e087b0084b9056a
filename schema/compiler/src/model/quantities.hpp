#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// What the schema says of the numbers in a payload, a line for each field that says something:
/// "request.force.x: newton, -20 to 20, in the frame base". `role` is "request" or "reply".
[[nodiscard]] Documentation quantities(const Model& model, const Payload& payload,
                                       const std::string& role);

/// The same of one field: "newton, -20 to 20, in the frame base"; empty if it says nothing.
[[nodiscard]] std::string quantity(const Field& field);

}  // namespace rtpm::schema
