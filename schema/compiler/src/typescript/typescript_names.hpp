#pragma once

#include <string>
#include <string_view>

#include "rtpm/schema/model.hpp"

/// The TypeScript names of a schema's declarations.
namespace rtpm::schema::typescript {

/// Whether TypeScript shows a field. Deprecated fields and the types of unions are hidden.
[[nodiscard]] bool is_shown(const Field& field) noexcept;
/// Whether TypeScript has a type for it. `rtpm.Empty` is no argument and undefined.
[[nodiscard]] bool is_shown(const Object& object) noexcept;

/// "xNewton" for "x_newton"; a name that objects or classes have gets a trailing underscore.
[[nodiscard]] std::string member(std::string_view name);
/// An enum's value: as in the schema.
[[nodiscard]] std::string value_name(std::string_view name);

/// A type in the module of the compiled file, or the stem of a service's names: "Force" for
/// "lab.Force"; "lab_Force" if the model has another Force. Names that generated code uses get a
/// trailing underscore.
[[nodiscard]] std::string type_name(const Model& model, const std::string& qualified_name);
/// The same type in the module of the file that declares it.
[[nodiscard]] std::string name_in_module_of(const Model& model, const std::string& qualified_name,
                                            const std::string& file);

/// The constant of an event: "TouchedEvent" for "Touched", "LeftEventType" for "LeftEvent".
[[nodiscard]] std::string event_name(const Model& model, const std::string& table);
/// The function that checks the ranges of a type.
[[nodiscard]] std::string check_name(const Model& model, const std::string& qualified_name);
/// The function that makes a service's skeleton: "armSkeleton".
[[nodiscard]] std::string skeleton_name(const Model& model, const std::string& service);

/// A string literal.
[[nodiscard]] std::string literal(std::string_view text);
/// A template literal, for texts of several lines.
[[nodiscard]] std::string template_literal(std::string_view text);
/// `lines` as a comment of TSDoc.
[[nodiscard]] std::string comment(const Documentation& lines, const std::string& indent);

}  // namespace rtpm::schema::typescript
