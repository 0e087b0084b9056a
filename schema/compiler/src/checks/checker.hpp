#pragma once

#include <deque>

#include "reading/outline.hpp"
#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Checks `model` against all of RTPM's rules, and sets its attribute values and the locations of
/// its declarations.
/// @param texts  the compiled file first, then all included files
/// @return every breach; back ends must not get a model with breaches
[[nodiscard]] Diagnostics check(Model& model, const std::deque<SchemaText>& texts);

}  // namespace rtpm::schema
