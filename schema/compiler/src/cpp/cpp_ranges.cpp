#include "cpp/cpp_ranges.hpp"

#include <cstddef>
#include <string>

#include "cpp/cpp_names.hpp"
#include "model/reach.hpp"
#include "model/words.hpp"

namespace rtpm::schema::cpp {
namespace {

std::string union_head(const Enum& enumeration) {
  return "bool rtpm_in_range(" + type_name(enumeration.name) +
         " type, const void* value,\n                   ::rtpm::rpc::RangeCheck& check) noexcept";
}

std::string object_head(const Object& object) {
  return "bool rtpm_in_range(const " + type_name(object.name) +
         "& value,\n                   ::rtpm::rpc::RangeCheck& check) noexcept";
}

std::size_t handled_as(const Payload& payload) {
  return payload.struct_index.value_or(payload.table);
}

}  // namespace

/// An expression that is true if the field is within its range.
std::string Ranges::field_check(const Object& object, const Field& field) const {
  const std::string name = data_name(field.name);
  const std::string value = "value." + name + "()";
  const std::string word = literal(field.name);
  if (field.range) {
    const std::string low = number_text(field.range->low);
    const std::string high = number_text(field.range->high);
    const std::string unit = field.unit.empty() ? "" : ' ' + field.unit;
    return std::string("check.number") + (field.type.is_many() ? "s(" : "(") + value + ", " + low +
           ", " + high + ", " + word + ", " + literal(low + " to " + high + unit) + ')';
  }
  if (field.type.innermost() == BaseType::kUnion) {
    const std::string types = "value." + name + "_type()";
    if (field.type.is_many()) {
      const std::string type = type_name(model_.enums[*field.type.index].name);
      return "check.members<" + type + ">(\n             " + types + ", " + value + ", " + word +
             ",\n             [&](" + type +
             " type, const void* item) { return rtpm_in_range(type, item, check); })";
    }
    return "(" + value + " == nullptr || rtpm_in_range(" + types + ", " + value +
           ", check) ||\n          check.within(" + word + "))";
  }
  if (field.type.is_many()) {
    return "check.items(" + value + ", " + word +
           ",\n                     [&](const auto& item) { return rtpm_in_range(item, check); })";
  }
  const std::string within = " || check.within(" + word + "))";
  if (object.is_struct) return "(rtpm_in_range(" + value + ", check)" + within;
  return "(" + value + " == nullptr || rtpm_in_range(*" + value + ", check)" + within;
}

std::string Ranges::definition(const Object& object) const {
  std::string checks;
  for (const Field& field : object.fields) {
    if (field.is_deprecated || (!field.range && !types_.has(field.type))) continue;
    checks += (checks.empty() ? "" : " &&\n         ") + field_check(object, field);
  }
  return object_head(object) + " {\n  return " + checks + ";\n}\n";
}

std::string Ranges::definition(const Enum& enumeration) const {
  std::string text = union_head(enumeration) + " {\n  switch (type) {\n";
  for (const EnumValue& value : enumeration.values) {
    if (!types_.has(value.union_type)) continue;
    text += "    case " + type_name(enumeration.name) + "::" + data_name(value.name) +
            ":\n      return rtpm_in_range(*static_cast<const " +
            type_name(model_.objects[*value.union_type.index].name) + "*>(value), check);\n";
  }
  return text + "    default:\n      return true;\n  }\n}\n";
}

std::string Ranges::functions() const {
  Reach reach;
  for (const Service& service : model_.services) {
    for (const Method& method : service.methods) {
      if (method.request.kind != PayloadKind::kEmpty) reach.add(model_, handled_as(method.request));
    }
  }
  std::string heads;
  std::string bodies;
  for (const std::size_t index : reach.objects) {
    if (!types_.has_object(index)) continue;
    heads += object_head(model_.objects[index]) + ";\n";
    bodies += '\n' + definition(model_.objects[index]);
  }
  for (const std::size_t index : reach.enums) {
    if (!types_.has_union(index)) continue;
    heads += union_head(model_.enums[index]) + ";\n";
    bodies += '\n' + definition(model_.enums[index]);
  }
  if (heads.empty()) return {};
  return "\nnamespace {\n\n// Whether the numbers of a request are within their rtpm_range.\n" +
         heads + bodies + "\n}  // namespace\n";
}

}  // namespace rtpm::schema::cpp
