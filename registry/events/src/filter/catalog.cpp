#include "filter/catalog.hpp"

#include <algorithm>

#include "filter/compiler.hpp"

namespace rtpm::events {
namespace {

bool is_sound(const FieldDescriptor& field, std::size_t name_size_max) {
  return !field.name.empty() && field.name.size() <= name_size_max &&
         static_cast<int>(field.type) < kScalarTypeCount &&
         field.path.slot_count <= FieldPath::kSlotCountMax;
}

}  // namespace

expected<void, SetupError> TypeCatalog::add(const EventDescriptor& descriptor) {
  const std::string what = in_words(descriptor.type, &descriptor);
  if (descriptor.type == 0 || descriptor.type > kEventTypeMax) {
    return setup_error(what, "a type is 1 to " + std::to_string(kEventTypeMax));
  }
  if (const EventDescriptor* known = find(descriptor.type)) {
    if (known->schema_id == descriptor.schema_id) return {};
    return setup_error(
        what, "the hub knows this type as " + std::string(known->name) + " of another schema",
        "give it another rtpm_event number, or build both programs from one schema");
  }
  if (descriptor.name.size() > limits_.name_size_max ||
      descriptor.fields.size() > limits_.field_count_max) {
    return setup_error(what, "it has too long a name, or too many fields");
  }
  if (types_.size() >= limits_.type_count_max) {
    return setup_error(
        what, "the hub knows " + std::to_string(types_.size()) + " types, which is its maximum");
  }
  auto owned = std::make_unique<Owned>();
  owned->name = descriptor.name;
  owned->field_names.reserve(descriptor.fields.size());
  for (const FieldDescriptor& field : descriptor.fields) {
    if (!is_sound(field, limits_.name_size_max)) {
      return setup_error(what, "'" + std::string(field.name) + "' has an invalid descriptor");
    }
    owned->field_names.emplace_back(field.name);
    owned->fields.push_back(field);
    owned->fields.back().name = owned->field_names.back();
  }
  if (descriptor.schema.size() <= limits_.schema_size_max) owned->schema = descriptor.schema;
  owned->descriptor = {descriptor.type, owned->name, descriptor.schema_id, owned->fields,
                       owned->schema};
  types_.emplace(descriptor.type, std::move(owned));
  return {};
}

const EventDescriptor* TypeCatalog::find(EventType type) const noexcept {
  const auto found = types_.find(type);
  return found == types_.end() ? nullptr : &found->second->descriptor;
}

std::vector<const EventDescriptor*> TypeCatalog::list() const {
  std::vector<const EventDescriptor*> list;
  for (const auto& [number, owned] : types_)
    list.push_back(&owned->descriptor);
  return list;
}

}  // namespace rtpm::events
