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

/// How long the caller of a oneway waits: "waits until it ran".
[[nodiscard]] std::string waiting_of(OnewayLevel level);
/// The facts of a method for its callers, in sentences, each with a blank before it; empty if all is
/// as usual.
[[nodiscard]] std::string method_facts(const Method& method);
/// The priority of a service's methods as a sentence; empty if it states none.
[[nodiscard]] std::string priority_facts(const Service& service);

}  // namespace rtpm::schema
