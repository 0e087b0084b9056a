#pragma once

#include <cstddef>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema::typescript {

/// The type of a field or of a union's member, without `| undefined`.
[[nodiscard]] std::string value_type(const Model& model, const Type& type);
/// The codec of a type: "Force.codec".
[[nodiscard]] std::string codec(const Model& model, const Type& type);
/// The type of a request, reply or item: "Force", "void".
[[nodiscard]] std::string payload_type(const Model& model, const Payload& payload);
/// The codec of a request, reply or item.
[[nodiscard]] std::string payload_codec(const Model& model, const Payload& payload);
/// "Float64Array" for doubles; empty for types without an array of their own.
[[nodiscard]] std::string numbers_type(BaseType element);
/// The method of TableReader, TableWriter and scalars for a number: "float64".
[[nodiscard]] std::string accessor(BaseType base);
/// A number as a literal of its type; `Mode.Hold` for an enum.
[[nodiscard]] std::string default_value(const Model& model, const Field& field);

/// The declarations of one type.
[[nodiscard]] std::string enum_text(const Model& model, const Enum& enumeration);
[[nodiscard]] std::string union_text(const Model& model, const Enum& enumeration);
[[nodiscard]] std::string struct_text(const Model& model, const Object& object);
/// @param index  in Model::objects
[[nodiscard]] std::string table_text(const Model& model, std::size_t index);
/// The interface with the fields of a struct or table.
[[nodiscard]] std::string fields_text(const Model& model, const Object& object);
/// The constant of an event; empty if the table is no event.
[[nodiscard]] std::string event_text(const Model& model, std::size_t index);
/// The functions that check the ranges of requests; empty if there are none.
[[nodiscard]] std::string checks_text(const Model& model);
/// A service's methods, interface, client and servant.
[[nodiscard]] std::string service_text(const Model& model, const Service& service,
                                       const std::string& compiler_version);

}  // namespace rtpm::schema::typescript
