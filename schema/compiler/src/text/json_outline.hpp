#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

/// Where the values of a JSON text are, in FlatBuffers' form, in which names need no quotation
/// marks. For errors: FlatBuffers' parser tells a position, and users think in fields.
namespace rtpm::schema {

/// A value, and what is in it.
/// @ownership views the text
struct JsonOutline {
  std::string_view name{};  ///< Empty: the whole, or an array's element.
  std::size_t begin = 0;
  std::size_t end = 0;
  std::string_view word{};  ///< What is no object and no array, without quotation marks.
  bool is_object = false;
  std::vector<JsonOutline> members{};  ///< Of an object or an array.
};

/// The outline of a text; of one that is no JSON, up to its mistake. What is nested deeper than 64
/// is left out.
[[nodiscard]] JsonOutline outline_of(std::string_view text);

/// The name of the only member of an object such as `{name: {…}}`; empty: it is not like this.
[[nodiscard]] std::string_view only_name(std::string_view text);

/// The field whose value ends before `offset`, with at most one token between: "force.x",
/// "points[2].z"; empty: none.
[[nodiscard]] std::string field_before(const JsonOutline& whole, std::string_view text,
                                       std::size_t offset);

/// Which fields the first incomplete struct lacks, as a sentence; empty: none is incomplete.
/// @param object  what `whole` is one of, in the model's objects
[[nodiscard]] std::string lacking_fields(const Model& model, std::size_t object,
                                         const JsonOutline& whole);

/// The first field whose number does not fit its type, or whose array has not its length; empty:
/// none is found. FlatBuffers' parser notices these only at the end of their table.
/// @param object  what `whole` is one of, in the model's objects
[[nodiscard]] std::string misfit_field(const Model& model, std::size_t object,
                                       const JsonOutline& whole);

/// `json` with null in place of nan and inf, which FlatBuffers prints and JSON does not have.
[[nodiscard]] std::string with_null_for_no_number(std::string_view json);

}  // namespace rtpm::schema
