#pragma once

#include <flatbuffers/idl.h>

#include "rtpm/schema/model.hpp"

/// Arrays of structs as fields of the same bytes, because viewers refuse schemas that have arrays:
/// `joints:[double:2]` becomes `joints_0:double; joints_1:double`, each with the attribute
/// `rtpm_array: "joints"`, by which RTPM's own readers make it an array again.
namespace rtpm::schema {

inline constexpr const char* kArrayAttribute = "rtpm_array";

/// Replaces the arrays of the parser's structs. Its schema must declare kArrayAttribute.
void flatten_arrays(const flatbuffers::Parser& parser);

/// Reverses flatten_arrays() in a model. Leaves fields that are not the elements of an array.
void restore_arrays(Model& model);

}  // namespace rtpm::schema
