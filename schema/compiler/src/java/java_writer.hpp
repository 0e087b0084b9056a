#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "java/java_names.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema::java {

/// The input of all writers.
struct Context {
  const Model& model;
  const Names& names;
  const std::string& compiler_version;
  /// The package whose types are named without it; empty in a file that hides their names.
  std::string package{};

  /// The name of a type in the file.
  [[nodiscard]] std::string name(const Object& object) const {
    return names.package_of(object.name, object.declaration_file) == package
               ? names.type(object.name)
               : names.whole(object);
  }
  [[nodiscard]] std::string name(const Enum& enumeration) const {
    return names.package_of(enumeration.name, enumeration.declaration_file) == package
               ? names.type(enumeration.name)
               : names.whole(enumeration);
  }
};

/// The Java type of a field or of a union's member, for values.
[[nodiscard]] std::string value_type(const Context& context, const Type& type, bool is_optional);
/// The method of TableReader, TableWriter and Scalars for a number: "float64".
[[nodiscard]] std::string accessor(const Type& type);
/// The codec of a type: "lab.Force.CODEC".
[[nodiscard]] std::string codec(const Context& context, const Type& type);
/// The type of a request, reply or item: "lab.Force", "Void".
[[nodiscard]] std::string payload_type(const Context& context, const Payload& payload);
/// The codec of a request, reply or item.
[[nodiscard]] std::string payload_codec(const Context& context, const Payload& payload);
/// A number as a literal of its type; `Mode.HOLD` or `new Mode(7L)` for an enum.
[[nodiscard]] std::string default_value(const Context& context, const Field& field);

/// The comment of a field's setter or getter: "The distance (metre)".
[[nodiscard]] std::string field_comment(const Field& field);
/// A method's comment with its quantities and facts.
[[nodiscard]] std::string method_comment(const Context& context, const Method& method);

/// The number of a default: an enum's, too.
[[nodiscard]] std::string default_number(const Field& field);
/// A literal of a double or float.
[[nodiscard]] std::string real_literal(double value, bool is_float);

/// Puts the banner, the package and the imports that `body` needs before it.
[[nodiscard]] GeneratedFile file(const Context& context, const std::string& package,
                                 const std::string& class_name, const std::string& body);

/// "/** … */ public record Force(double x)", with notes on its components.
[[nodiscard]] std::string record_head(const Context& context, const Object& object);
/// The constructor that replaces null, where a field is absent, by the field's value; may be empty.
[[nodiscard]] std::string record_constructor(const Context& context, const Object& object);
/// equals() and so on of a record with arrays, which records compare by identity.
[[nodiscard]] std::string record_comparison(const Context& context, const Object& object);

[[nodiscard]] GeneratedFile enum_file(const Context& context, const Enum& enumeration);
[[nodiscard]] GeneratedFile union_file(const Context& context, const Enum& enumeration);
[[nodiscard]] GeneratedFile struct_file(const Context& context, const Object& object);
/// @param index  in Model::objects
[[nodiscard]] GeneratedFile table_file(const Context& context, std::size_t index);
/// The files of a service's methods, client and servant.
[[nodiscard]] std::vector<GeneratedFile> service_files(const Context& context,
                                                       const Service& service);
/// The constant EVENT of a table; empty if it is no event.
[[nodiscard]] std::string event_constant(const Context& context, std::size_t index);

}  // namespace rtpm::schema::java
