#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// A schema with one service and all types that it needs, without includes, for tools that have no
/// generated code. Compiled again, the service has the same fingerprint, comments and units.
/// Attributes of other tools are left out.
[[nodiscard]] std::string schema_text(const Model& model, const Service& service);

/// The same for a table, such as an event: it is the root type.
/// @param table  one of the model's objects
[[nodiscard]] std::string schema_text(const Model& model, const Object& table);

}  // namespace rtpm::schema
