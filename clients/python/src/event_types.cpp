#include "event_types.hpp"

#include <cstdint>
#include <utility>

#include "rtpm/schema/schema_text.hpp"

namespace rtpm::python {
namespace {

using schema::BaseType;
using schema::Field;
using schema::Model;

/// The most numbers of an event that a hub reads.
constexpr std::size_t kFieldCountMax = 256;

events::Scalar default_of(const Field& field) noexcept {
  switch (field.type.base) {
    case BaseType::kFloat:
    case BaseType::kDouble:
      return events::Scalar::of(field.default_real);
    case BaseType::kBool:
    case BaseType::kUint8:
    case BaseType::kUint16:
    case BaseType::kUint32:
    case BaseType::kUint64:
      return events::Scalar::of(static_cast<std::uint64_t>(field.default_integer));
    default:
      return events::Scalar::of(field.default_integer);
  }
}

/// Adds the numbers of an event's payload, outside arrays, vectors and unions.
class Numbers {
 public:
  Numbers(const Model& model, EventTypeOf& type) : model_(model), type_(type) {}

  void add_struct(std::size_t index, const std::string& lead, const events::FieldPath& path) {
    for (const Field& field : model_.objects[index].fields) {
      events::FieldPath at = path;
      at.offset = static_cast<std::uint16_t>(path.offset + field.offset);
      if (field.type.base == BaseType::kObject) {
        add_struct(*field.type.index, lead + field.name + '.', at);
      } else {
        add(field, lead, at);
      }
    }
  }

  void add_table(std::size_t index, const std::string& lead, const events::FieldPath& path) {
    if (path.slot_count == events::FieldPath::kSlotCountMax) return;
    for (const Field& field : model_.objects[index].fields) {
      if (field.is_deprecated) continue;
      events::FieldPath at = path;
      at.slots[at.slot_count++] = static_cast<std::uint16_t>(field.id);
      if (field.type.base != BaseType::kObject) {
        add(field, lead, at);
      } else if (model_.objects[*field.type.index].is_struct) {
        add_struct(*field.type.index, lead + field.name + '.', at);
      } else {
        add_table(*field.type.index, lead + field.name + '.', at);
      }
    }
  }

 private:
  void add(const Field& field, const std::string& lead, const events::FieldPath& path) {
    if (field.type.base < BaseType::kBool || field.type.base > BaseType::kDouble) return;
    if (type_.fields.size() == kFieldCountMax) return;
    // Both enumerations have the same order.
    const auto scalar = static_cast<events::ScalarType>(static_cast<int>(field.type.base) -
                                                        static_cast<int>(BaseType::kBool));
    type_.fields.push_back(
        {.name = type_.field_names.emplace_back(lead + field.name),
         .type = scalar,
         .path = path,
         .default_value = path.slot_count > 0 ? default_of(field) : events::Scalar{}});
  }

  const Model& model_;
  EventTypeOf& type_;
};

}  // namespace

std::unique_ptr<EventTypeOf> event_type_of(const Model& model, std::size_t object) {
  const schema::Object& table = model.objects.at(object);
  auto type = std::make_unique<EventTypeOf>();
  type->name = table.name;
  type->schema = schema::schema_text(model, table);
  const schema::Payload payload = schema::payload_of(model, object);
  Numbers numbers(model, *type);
  if (payload.kind == schema::PayloadKind::kStruct) {
    numbers.add_struct(*payload.struct_index, "", {});
  } else {
    numbers.add_table(object, "", {});
  }
  type->descriptor = {.type = table.event_id.value_or(0),
                      .name = type->name,
                      .schema_id = table.event_fingerprint,
                      .fields = type->fields,
                      .schema = type->schema};
  return type;
}

}  // namespace rtpm::python
