#include "reading/flat_arrays.hpp"

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace rtpm::schema {
namespace {

std::size_t size_of(const Model& model, const Type& type) {
  return type.base == BaseType::kObject ? model.objects[*type.index].byte_size : size_of(type.base);
}

/// The array's name, if the field is an element of one.
const std::string* array_of(const Field& field) {
  const auto found = std::ranges::find(field.attributes, kArrayAttribute, &Attribute::name);
  return found == field.attributes.end() ? nullptr : &found->value;
}

/// How many fields from `first` on are the elements of one array.
std::size_t element_count(const Model& model, const std::vector<Field>& fields, std::size_t first) {
  const std::string* const name = array_of(fields[first]);
  const Type& type = fields[first].type;
  const bool has_size = type.base == BaseType::kObject ||
                        (type.base >= BaseType::kBool && type.base <= BaseType::kDouble);
  if (name == nullptr || !has_size) return 0;
  const std::size_t size = size_of(model, type);
  std::size_t count = 1;
  for (; first + count < fields.size(); ++count) {
    const Field& next = fields[first + count];
    const std::string* const its_name = array_of(next);
    const bool follows = its_name != nullptr && *its_name == *name && next.type.base == type.base &&
                         next.type.index == type.index &&
                         next.offset == fields[first].offset + count * size;
    if (!follows) break;
  }
  return count;
}

Field array_from(const Field& first, std::size_t count) {
  Field array = first;
  array.name = *array_of(first);
  array.type.element = first.type.base;
  array.type.base = BaseType::kArray;
  array.type.fixed_length = static_cast<std::uint16_t>(count);
  std::erase_if(array.attributes,
                [](const Attribute& each) { return each.name == kArrayAttribute; });
  return array;
}

/// A name that no other field of the struct has.
std::string element_name(const std::string& array, std::size_t index,
                         std::set<std::string>& taken) {
  std::string name = array + "_" + std::to_string(index);
  while (!taken.insert(name).second)
    name += '_';
  return name;
}

std::unique_ptr<flatbuffers::FieldDef> element_of(const flatbuffers::FieldDef& array,
                                                  std::size_t index) {
  auto element = std::make_unique<flatbuffers::FieldDef>();
  element->value.type = array.value.type.VectorType();
  element->value.type.fixed_length = 0;
  const std::size_t size = flatbuffers::InlineSize(element->value.type);
  element->value.offset = static_cast<flatbuffers::voffset_t>(array.value.offset + index * size);
  for (const auto& [name, value] : array.attributes.dict)
    element->attributes.Add(name, std::make_unique<flatbuffers::Value>(*value).release());
  auto attribute = std::make_unique<flatbuffers::Value>();
  attribute->constant = array.name;
  element->attributes.Add(kArrayAttribute, attribute.release());
  const bool is_last = index + 1U == array.value.type.fixed_length;
  element->padding = is_last ? array.padding : 0;
  return element;
}

}  // namespace

void flatten_arrays(const flatbuffers::Parser& parser) {
  for (flatbuffers::StructDef* const type : parser.structs_.vec) {
    std::set<std::string> taken;
    for (const flatbuffers::FieldDef* const field : type->fields.vec)
      taken.insert(field->name);
    // The table of symbols owns its fields.
    const auto before = std::exchange(type->fields.vec, {});
    type->fields.dict.clear();
    for (flatbuffers::FieldDef* const given : before) {
      std::unique_ptr<flatbuffers::FieldDef> field(given);
      if (field->value.type.base_type != flatbuffers::BASE_TYPE_ARRAY) {
        const std::string name = field->name;
        type->fields.Add(name, field.release());
        continue;
      }
      for (std::size_t i = 0; i < field->value.type.fixed_length; ++i) {
        auto element = element_of(*field, i);
        element->name = element_name(field->name, i, taken);
        const std::string name = element->name;
        type->fields.Add(name, element.release());
      }
    }
  }
}

void restore_arrays(Model& model) {
  for (Object& object : model.objects) {
    if (!object.is_struct) continue;
    std::vector<Field> fields;
    for (std::size_t i = 0; i < object.fields.size();) {
      const std::size_t count = element_count(model, object.fields, i);
      fields.push_back(count == 0 ? object.fields[i] : array_from(object.fields[i], count));
      fields.back().id = static_cast<std::uint16_t>(fields.size() - 1);
      i += std::max<std::size_t>(count, 1);
    }
    object.fields = std::move(fields);
  }
}

}  // namespace rtpm::schema
