#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The whole schema with the types of included files, without includes. Compiling it results in the
/// same types, and in services and events with the same fingerprints.
[[nodiscard]] std::string schema_text(const Model& model);

/// A schema with one service and all types that it needs, without includes, for tools without
/// generated code. Compiling it results in a service with the same fingerprint, comments and units.
/// Leaves out attributes of other tools.
[[nodiscard]] std::string schema_text(const Model& model, const Service& service);

/// The schema of a table, such as an event, which becomes the root type.
/// @param table  one of the model's objects
[[nodiscard]] std::string schema_text(const Model& model, const Object& table);

}  // namespace rtpm::schema
