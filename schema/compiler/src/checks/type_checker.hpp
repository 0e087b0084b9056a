#pragma once

#include <deque>

#include "reading/outline.hpp"
#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Gives tables, structs, enums and their members their places and what their attributes say, and
/// reports what is wrong with those.
void check_types(Model& model, const std::deque<SchemaText>& texts, Diagnostics& errors);

}  // namespace rtpm::schema
