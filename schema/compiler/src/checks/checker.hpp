#pragma once

#include <deque>

#include "reading/outline.hpp"
#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Checks `model` against RTPM's rules, every one of them, and gives declarations what their
/// attributes say and their places. `texts` are the compiled file, first, and all that it includes.
/// Returns every breach; a model with breaches is not for generating.
[[nodiscard]] Diagnostics check(Model& model, const std::deque<SchemaText>& texts);

}  // namespace rtpm::schema
