#pragma once

#include <deque>

#include "reading/outline.hpp"
#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Sets the locations and attribute values of tables, structs, enums and their members, and reports
/// invalid attributes.
void check_types(Model& model, const std::deque<SchemaText>& texts, Diagnostics& errors);

}  // namespace rtpm::schema
