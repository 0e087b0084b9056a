#include "text/range_check.hpp"

#include <optional>

#include "model/words.hpp"
#include "text/table_access.hpp"

namespace rtpm::schema {
namespace {

using flatbuffers::ReadScalar;

std::optional<double> number_at(BaseType type, const std::uint8_t* data) {
  switch (type) {
    case BaseType::kInt8:
      return ReadScalar<std::int8_t>(data);
    case BaseType::kUint8:
      return ReadScalar<std::uint8_t>(data);
    case BaseType::kInt16:
      return ReadScalar<std::int16_t>(data);
    case BaseType::kUint16:
      return ReadScalar<std::uint16_t>(data);
    case BaseType::kInt32:
      return ReadScalar<std::int32_t>(data);
    case BaseType::kUint32:
      return ReadScalar<std::uint32_t>(data);
    case BaseType::kInt64:
      return static_cast<double>(ReadScalar<std::int64_t>(data));
    case BaseType::kUint64:
      return static_cast<double>(ReadScalar<std::uint64_t>(data));
    case BaseType::kFloat:
      return ReadScalar<float>(data);
    case BaseType::kDouble:
      return ReadScalar<double>(data);
    default:
      return std::nullopt;
  }
}

/// Walks a buffer until it finds a number outside its range.
class RangeCheck {
 public:
  explicit RangeCheck(const Model& model) : model_(model) {}

  [[nodiscard]] std::string table(std::size_t index, const std::uint8_t* data,
                                  const std::string& path) const {
    const auto& table = *reinterpret_cast<const flatbuffers::Table*>(data);
    for (const Field& field : model_.objects[index].fields) {
      const std::uint8_t* const at = table.GetAddressOf(slot_of(field.id));
      if (at == nullptr) continue;  // An absent field has its default, which is within the range.
      const std::string found = field.type.base == BaseType::kUnion
                                    ? union_of(table, field, follow(at), path)
                                    : value(field, at, path + field.name);
      if (!found.empty()) return found;
    }
    return {};
  }

 private:
  [[nodiscard]] std::string structure(std::size_t index, const std::uint8_t* data,
                                      const std::string& path) const {
    for (const Field& field : model_.objects[index].fields) {
      std::string found = value(field, data + field.offset, path + field.name);
      if (!found.empty()) return found;
    }
    return {};
  }

  /// The slot before a union's value contains its type.
  [[nodiscard]] std::string union_of(const flatbuffers::Table& table, const Field& field,
                                     const std::uint8_t* data, const std::string& path) const {
    const auto type = table.GetField<std::uint8_t>(slot_of(field.id - std::size_t{1}), 0);
    for (const EnumValue& member : model_.enums[*field.type.index].values) {
      if (member.value != type || !member.union_type.has_object()) continue;
      return object(*member.union_type.index, data, path + field.name + ".");
    }
    return {};
  }

  [[nodiscard]] std::string object(std::size_t index, const std::uint8_t* data,
                                   const std::string& path) const {
    return model_.objects[index].is_struct ? structure(index, data, path)
                                           : table(index, data, path);
  }

  [[nodiscard]] std::string value(const Field& field, const std::uint8_t* at,
                                  const std::string& name) const {
    if (field.type.is_many()) return many(field, at, name);
    if (!field.type.has_object()) return number(field, field.type.base, at, name);
    const std::size_t index = *field.type.index;
    return object(index, model_.objects[index].is_struct ? at : follow(at), name + ".");
  }

  [[nodiscard]] std::string many(const Field& field, const std::uint8_t* at,
                                 const std::string& name) const {
    const bool is_vector = field.type.base == BaseType::kVector;
    const bool has_object = field.type.has_object();
    if (!has_object && !field.range) return {};
    const std::uint8_t* data = is_vector ? follow(at) : at;
    std::size_t count = field.type.fixed_length;
    if (is_vector) {
      count = ReadScalar<flatbuffers::uoffset_t>(data);
      data += sizeof(flatbuffers::uoffset_t);
    }
    const Object* const element = has_object ? &model_.objects[*field.type.index] : nullptr;
    const bool is_inline = element == nullptr || element->is_struct;
    const std::size_t size = element == nullptr   ? size_of(field.type.element)
                             : element->is_struct ? element->byte_size
                                                  : sizeof(flatbuffers::uoffset_t);
    for (std::size_t i = 0; i < count; ++i, data += size) {
      const std::string path = name + "[" + std::to_string(i) + "]";
      std::string found =
          has_object ? object(*field.type.index, is_inline ? data : follow(data), path + ".")
                     : number(field, field.type.element, data, path);
      if (!found.empty()) return found;
    }
    return {};
  }

  [[nodiscard]] static std::string number(const Field& field, BaseType type, const std::uint8_t* at,
                                          const std::string& name) {
    if (!field.range) return {};
    const auto number = number_at(type, at);
    // NaN is outside every range.
    if (!number || (*number >= field.range->low && *number <= field.range->high)) return {};
    const std::string unit = field.unit.empty() ? "" : " " + field.unit;
    return name + " is " + number_text(*number) + ", but must be " + number_text(field.range->low) +
           " to " + number_text(field.range->high) + unit;
  }

  const Model& model_;
};

}  // namespace

std::string out_of_range(const Model& model, std::size_t table, const std::uint8_t* buffer) {
  const auto* const root = buffer + ReadScalar<flatbuffers::uoffset_t>(buffer);
  return RangeCheck(model).table(table, root, "");
}

}  // namespace rtpm::schema
