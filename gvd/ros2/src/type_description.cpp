#include "rtpm/ros2/type_description.hpp"

#include <span>

#include "rtpm/base/assert.hpp"
#include "rtpm/crypto/primitives.hpp"
#include "rtpm/ros2/messages.hpp"

namespace rtpm::ros2 {
namespace {

/// "geometry_msgs/Pose", from "geometry_msgs/msg/Pose", as definitions name types.
std::string short_name(std::string_view type) {
  const std::size_t package = type.find('/');
  return std::string(type.substr(0, package)) + std::string(type.substr(type.rfind('/')));
}

std::string_view word_of(std::uint8_t number_type) {
  switch (number_type) {
    case kNumberType<std::uint8_t>:
      return "uint8";
    case kNumberType<std::int32_t>:
      return "int32";
    case kNumberType<std::uint32_t>:
      return "uint32";
    case kNumberType<float>:
      return "float32";
    case kNumberType<double>:
      return "float64";
    case kNumberType<bool>:
      return "bool";
    case kNumberType<std::byte>:
      return "byte";
    case kTextType:
      return "string";
    default:
      RTPM_ASSERT(false, "a field has a type without a word");
      return {};
  }
}

/// "float64[9]", "geometry_msgs/Pose", "string<=256".
std::string type_text(FieldType type) {
  std::string suffix;
  if (type.type_id >= kSequence) {
    suffix = "[]";
    type.type_id = static_cast<std::uint8_t>(type.type_id - kSequence);
  } else if (type.type_id > kArray) {
    suffix = "[" + std::to_string(type.capacity) + "]";
    type.type_id = static_cast<std::uint8_t>(type.type_id - kArray);
  }
  if (type.type_id == kNestedType) return short_name(type.nested) + suffix;
  if (type.type_id == kBoundedTextType)
    return "string<=" + std::to_string(type.text_capacity) + suffix;
  return std::string(word_of(type.type_id)) + suffix;
}

/// As rosidl writes it for the hash. Names have no character that JSON escapes.
std::string json_of(const TypeDescription& type) {
  std::string fields;
  for (const Field& field : type.fields) {
    if (!fields.empty()) fields += ", ";
    fields += R"({"name": ")" + std::string(field.name) + R"(", "type": {"type_id": )" +
              std::to_string(field.type.type_id) + R"(, "capacity": )" +
              std::to_string(field.type.capacity) + R"(, "string_capacity": )" +
              std::to_string(field.type.text_capacity) + R"(, "nested_type_name": ")" +
              std::string(field.type.nested) + R"("}})";
  }
  return R"({"type_name": ")" + std::string(type.name) + R"(", "fields": [)" + fields + "]}";
}

}  // namespace

std::string definition_of(const std::vector<TypeDescription>& types) {
  std::string text;
  for (const TypeDescription& type : types) {
    if (&type != types.data()) {
      text.append(80, '=');
      text += "\nMSG: " + short_name(type.name) + "\n";
    }
    for (const Field& field : type.fields) {
      if (field.name != kEmptyField)
        text += type_text(field.type) + " " + std::string(field.name) + "\n";
    }
  }
  return text;
}

std::string type_hash_of(const std::vector<TypeDescription>& types) {
  std::string contained;
  for (std::size_t i = 1; i < types.size(); ++i)
    contained += (i > 1 ? ", " : "") + json_of(types[i]);
  const std::string text = R"({"type_description": )" + json_of(types.front()) +
                           R"(, "referenced_type_descriptions": [)" + contained + "]}";
  std::string hash = "RIHS01_";
  for (const std::byte byte : crypto::sha256(std::as_bytes(std::span(text)), {})) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    hash += kDigits[std::to_integer<std::size_t>(byte >> 4)];
    hash += kDigits[std::to_integer<std::size_t>(byte & std::byte{15})];
  }
  return hash;
}

}  // namespace rtpm::ros2
