#include "model/event_fields.hpp"

#include <utility>

namespace rtpm::schema {
namespace {

// How deep a hub reads payloads, and how many fields it reads per event.
constexpr std::size_t kSlotCountMax = 4;
constexpr std::size_t kFieldCountMax = 256;

class Walk {
 public:
  explicit Walk(const Model& model) : model_(model) {}

  std::vector<EventField> of(const Payload& payload) {
    const std::size_t index = payload.struct_index.value_or(payload.table);
    if (model_.objects[index].is_struct) {
      add_struct(index, "", {}, 0);
    } else {
      add_table(index, "", {});
    }
    return std::move(fields_);
  }

 private:
  using Slots = std::vector<std::uint16_t>;

  void add_struct(std::size_t index, const std::string& lead, const Slots& slots,
                  std::size_t offset) {
    for (const Field& field : model_.objects[index].fields) {
      const std::size_t at = offset + field.offset;
      if (field.type.base == BaseType::kObject) {
        add_struct(*field.type.index, lead + field.name + '.', slots, at);
      } else {
        add(field, lead, slots, at);
      }
    }
  }

  void add_table(std::size_t index, const std::string& lead, const Slots& above) {
    if (above.size() == kSlotCountMax) return;
    for (const Field& field : model_.objects[index].fields) {
      if (field.is_deprecated) continue;
      Slots slots = above;
      slots.push_back(field.id);
      if (field.type.base != BaseType::kObject) {
        add(field, lead, slots, 0);
      } else if (model_.objects[*field.type.index].is_struct) {
        add_struct(*field.type.index, lead + field.name + '.', slots, 0);
      } else {
        add_table(*field.type.index, lead + field.name + '.', slots);
      }
    }
  }

  void add(const Field& field, const std::string& lead, const Slots& slots, std::size_t offset) {
    const bool is_number =
        field.type.base >= BaseType::kBool && field.type.base <= BaseType::kDouble;
    if (!is_number || fields_.size() == kFieldCountMax) return;
    fields_.push_back({lead + field.name, field.type.base, slots, offset, &field});
  }

  const Model& model_;
  std::vector<EventField> fields_{};
};

}  // namespace

std::vector<EventField> event_fields(const Model& model, const Payload& payload) {
  return Walk(model).of(payload);
}

bool is_unsigned(BaseType type) noexcept {
  return type == BaseType::kBool || type == BaseType::kUint8 || type == BaseType::kUint16 ||
         type == BaseType::kUint32 || type == BaseType::kUint64;
}

}  // namespace rtpm::schema
