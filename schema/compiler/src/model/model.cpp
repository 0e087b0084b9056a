#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

std::string short_name(const std::string& qualified_name) {
  return qualified_name.substr(qualified_name.rfind('.') + 1);
}

std::string namespace_of(const std::string& qualified_name) {
  const std::size_t dot = qualified_name.rfind('.');
  return dot == std::string::npos ? std::string{} : qualified_name.substr(0, dot);
}

std::string referred_name(const Model& model, const Type& type) {
  if (!type.index) return {};
  return type.has_object() ? model.objects[*type.index].name : model.enums[*type.index].name;
}

Payload payload_of(const Model& model, std::size_t table) {
  const Object& object = model.objects[table];
  if (object.fields.empty() && object.name == "rtpm.Empty") {
    return {.kind = PayloadKind::kEmpty, .table = table, .struct_index = std::nullopt};
  }
  if (object.fields.size() == 1 && !object.is_struct) {
    const Field& field = object.fields.front();
    if (field.type.base == BaseType::kObject && field.is_required && !field.is_deprecated &&
        model.objects[*field.type.index].is_struct) {
      return {.kind = PayloadKind::kStruct, .table = table, .struct_index = field.type.index};
    }
  }
  return {.kind = PayloadKind::kTable, .table = table, .struct_index = std::nullopt};
}

}  // namespace rtpm::schema
