#include "model/ranged_types.hpp"

#include <algorithm>

namespace rtpm::schema {

RangedTypes::RangedTypes(const Model& model) : model_(model) {
  // Types may contain one another in cycles, so iterate until nothing is added.
  for (bool is_growing = true; is_growing;) {
    is_growing = false;
    for (std::size_t i = 0; i < model.objects.size(); ++i)
      is_growing |= has(model.objects[i]) && objects_.insert(i).second;
    for (std::size_t i = 0; i < model.enums.size(); ++i)
      is_growing |= has(model.enums[i]) && unions_.insert(i).second;
  }
}

bool RangedTypes::has(const Payload& payload) const {
  return payload.kind != PayloadKind::kEmpty &&
         objects_.contains(payload.struct_index.value_or(payload.table));
}

bool RangedTypes::has(const Type& type) const {
  if (!type.index) return false;
  if (type.has_object()) return objects_.contains(*type.index);
  return type.innermost() == BaseType::kUnion && unions_.contains(*type.index);
}

bool RangedTypes::has(const Object& object) const {
  return std::ranges::any_of(object.fields, [&](const Field& field) {
    return !field.is_deprecated && (field.range || has(field.type));
  });
}

bool RangedTypes::has(const Enum& enumeration) const {
  return enumeration.is_union &&
         std::ranges::any_of(enumeration.values,
                             [&](const EnumValue& value) { return has(value.union_type); });
}

}  // namespace rtpm::schema
