#pragma once

#include "outline.hpp"
#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Checks `model` against RTPM's rules, every one of them, and gives methods what their attributes
/// say (id, idempotent, deadline) and declarations their places. `text` is the outline of `source`.
/// Returns every breach; a model with breaches is not for generating.
[[nodiscard]] Diagnostics check(Model& model, const SourceFile& source, const Outline& text);

}  // namespace rtpm::schema
