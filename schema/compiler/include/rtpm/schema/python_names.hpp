#pragma once

#include <string>
#include <string_view>

#include "rtpm/schema/model.hpp"

/// The Python names of a schema's declarations, for generated files and for classes made at run
/// time.
namespace rtpm::schema {

/// The name of a field, an enum's value, a method or a type. Keywords, `self`, `mro`, and names that
/// begin and end with an underscore get a trailing underscore.
[[nodiscard]] std::string python_name(std::string_view name);

/// The class of a type, or the stem of a service's classes: "Force" for "lab.Force"; "lab_Force" if
/// the model has another Force.
/// @param qualified_name  of one of the model's objects, enums or services
[[nodiscard]] std::string python_type_name(const Model& model, const std::string& qualified_name);

/// The module generated for a schema file: "haptic_rtpm" for "haptic".
[[nodiscard]] std::string python_module_name(std::string_view file_stem);

/// Whether Python shows a field. Deprecated fields and the types of unions are hidden.
[[nodiscard]] bool is_in_python(const Field& field) noexcept;
/// Whether Python has a class for a type. `rtpm.Empty` is no argument and None.
[[nodiscard]] bool is_in_python(const Object& object) noexcept;

}  // namespace rtpm::schema
