#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

/// The positions of values in a JSON text in FlatBuffers' syntax, in which names need no quotation
/// marks. For errors: FlatBuffers' parser reports a position, but users think in fields.
namespace rtpm::schema {

/// A value and its members.
/// @ownership views the text
struct JsonOutline {
  std::string_view name{};  ///< The member's name; empty for the whole text and in arrays.
  std::size_t begin = 0;
  std::size_t end = 0;
  std::string_view word{};  ///< A value that is neither object nor array, unquoted.
  bool is_object = false;
  std::vector<JsonOutline> members{};  ///< The members of an object, or an array's elements.
};

/// The outline of a text; for invalid JSON, up to its mistake. Omits values nested deeper than 64.
[[nodiscard]] JsonOutline outline_of(std::string_view text);

/// The name of the only member of an object such as `{name: {…}}`; empty for other text.
[[nodiscard]] std::string_view only_name(std::string_view text);

/// The field whose value ends before `offset`, with at most one token in between: "force.x",
/// "points[2].z"; empty if there is none.
[[nodiscard]] std::string field_before(const JsonOutline& whole, std::string_view text,
                                       std::size_t offset);

/// The fields that the first incomplete struct lacks, as a sentence; empty if none is incomplete.
/// @param object  the index in the model's objects of the type of `whole`
[[nodiscard]] std::string lacking_fields(const Model& model, std::size_t object,
                                         const JsonOutline& whole);

/// The first field whose number does not fit its type, or whose array has the wrong length; empty
/// if there is none. FlatBuffers' parser only notices these at the end of their table.
/// @param object  the index in the model's objects of the type of `whole`
[[nodiscard]] std::string misfit_field(const Model& model, std::size_t object,
                                       const JsonOutline& whole);

/// `json` with null instead of nan and inf, which FlatBuffers prints and JSON lacks.
[[nodiscard]] std::string with_null_for_no_number(std::string_view json);

}  // namespace rtpm::schema
