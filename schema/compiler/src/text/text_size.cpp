#include "text/text_size.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "text/table_access.hpp"

namespace rtpm::schema {
namespace {

using flatbuffers::ReadScalar;

/// The space that quotation marks, a colon, a comma and blanks take around a name or value.
constexpr std::size_t kAround = 8;
/// The size of one byte of text escaped as \u00ff.
constexpr std::size_t kEscaped = 6;

/// Adds up the size of the printed text until it exceeds the limit.
class TextSize {
 public:
  TextSize(const Model& model, std::size_t size_max)
      : model_(model), left_(size_max), numbers_(model.enums.size()) {
    for (std::size_t i = 0; i < numbers_.size(); ++i)
      numbers_[i] = enum_size(model.enums[i]);
  }

  [[nodiscard]] bool is_exceeded() const noexcept { return is_exceeded_; }

  void table(std::size_t index, const std::uint8_t* data) {
    const auto& table = *reinterpret_cast<const flatbuffers::Table*>(data);
    for (const Field& field : model_.objects[index].fields) {
      if (is_exceeded_) return;
      add(field.name.size() + kAround);
      const std::uint8_t* const at = table.GetAddressOf(slot_of(field.id));
      if (field.type.base <= BaseType::kDouble) {
        add(number_size(field.type));  // Absent fields are printed, too.
      } else if (at != nullptr && field.type.base == BaseType::kUnion) {
        const auto type = table.GetField<std::uint8_t>(slot_of(field.id - std::size_t{1}), 0);
        union_value(model_.enums[*field.type.index], type, follow(at));
      } else if (at != nullptr) {
        value(field.type, at);
      }
    }
  }

 private:
  void add(std::size_t size) noexcept {
    is_exceeded_ = is_exceeded_ || size > left_;
    left_ -= std::min(size, left_);
  }

  /// The size of the names of all flags that a value may have.
  [[nodiscard]] static std::size_t enum_size(const Enum& enumeration) {
    std::size_t longest = 20;
    for (const EnumValue& value : enumeration.values)
      longest = std::max(longest, value.name.size() + 1);
    return longest * 8 * size_of(enumeration.underlying);
  }

  /// The size of a number, or of an element that is one.
  [[nodiscard]] std::size_t number_size(const Type& type) const {
    constexpr std::size_t kDigitMax = 28;
    return (type.index ? numbers_[*type.index] : kDigitMax) + kAround;
  }

  void object(std::size_t index, const std::uint8_t* data) {
    if (!model_.objects[index].is_struct) return table(index, data);
    for (const Field& field : model_.objects[index].fields) {
      if (is_exceeded_) return;
      add(field.name.size() + kAround);
      value(field.type, data + field.offset);
    }
  }

  void union_value(const Enum& members, std::uint8_t type, const std::uint8_t* data) {
    for (const EnumValue& member : members.values) {
      if (member.value != type) continue;
      if (member.union_type.has_object()) object(*member.union_type.index, data);
      if (member.union_type.base == BaseType::kString) string(data);
    }
  }

  void string(const std::uint8_t* data) {
    add(std::size_t{ReadScalar<flatbuffers::uoffset_t>(data)} * kEscaped + kAround);
  }

  /// Adds a value; `at` is the position of an offset, or of the number or struct itself.
  void value(const Type& type, const std::uint8_t* at) {
    if (type.is_many()) return many(type, at);
    if (type.base == BaseType::kString) return string(follow(at));
    if (!type.has_object()) return add(number_size(type));
    object(*type.index, model_.objects[*type.index].is_struct ? at : follow(at));
  }

  void many(const Type& type, const std::uint8_t* at) {
    const bool is_vector = type.base == BaseType::kVector;
    const std::uint8_t* data = is_vector ? follow(at) : at;
    std::size_t count = type.fixed_length;
    if (is_vector) {
      count = ReadScalar<flatbuffers::uoffset_t>(data);
      data += sizeof(flatbuffers::uoffset_t);
    }
    const bool is_struct = type.has_object() && model_.objects[*type.index].is_struct;
    if (!type.has_object() && type.element != BaseType::kString) {
      return add(count * number_size(type));
    }
    const std::size_t size =
        is_struct ? model_.objects[*type.index].byte_size : sizeof(flatbuffers::uoffset_t);
    for (std::size_t i = 0; i < count && !is_exceeded_; ++i, data += size) {
      add(kAround);
      if (!type.has_object()) {
        string(follow(data));
      } else {
        object(*type.index, is_struct ? data : follow(data));
      }
    }
  }

  const Model& model_;
  std::size_t left_;
  bool is_exceeded_ = false;
  std::vector<std::size_t> numbers_;  // The number size of each enum.
};

}  // namespace

bool has_text_of_at_most(std::size_t size_max, const Model& model, std::size_t table,
                         const std::uint8_t* buffer) {
  TextSize text(model, size_max);
  text.table(table, follow(buffer));
  return !text.is_exceeded();
}

}  // namespace rtpm::schema
