#include "model/spelling.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/words.hpp"

namespace rtpm::schema {

std::string_view spelling_of(BaseType type) noexcept {
  constexpr std::array<std::string_view, 18> kNames{
      "none",  "union_type", "bool",  "int8",   "uint8",  "int16",  "uint16", "int32", "uint32",
      "int64", "uint64",     "float", "double", "string", "vector", "object", "union", "array"};
  const auto index = static_cast<std::size_t>(type);
  return index < kNames.size() ? kNames[index] : "unknown";
}

std::string_view spelling_of(PayloadKind kind) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"empty", "struct", "table"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view spelling_of(OnewayLevel level) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"sent", "received", "done"};
  return kNames[static_cast<std::size_t>(level)];
}

std::string_view spelling_of(Role role) noexcept {
  constexpr std::array<std::string_view, 4> kNames{"observe", "command", "configure", "administer"};
  return kNames[static_cast<std::size_t>(role)];
}

std::string_view spelling_of(PriorityModel model) noexcept {
  return model == PriorityModel::kServerDeclared ? "server_declared" : "client_propagated";
}

std::string type_text(const Model& model, const Type& type) {
  std::string text = referred_name(model, type);
  if (text.empty()) text = spelling_of(type.innermost());
  if (type.base == BaseType::kVector) return '[' + text + ']';
  if (type.base == BaseType::kArray) {
    return '[' + text + ':' + std::to_string(type.fixed_length) + ']';
  }
  return text;
}

std::string default_text(const Model& model, const Field& field) {
  if (field.is_optional) return "null";
  if (field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble) {
    return number_text(field.default_real);
  }
  if (field.type.base == BaseType::kUint64) {
    return std::to_string(static_cast<std::uint64_t>(field.default_integer));
  }
  if (field.type.index) {
    for (const EnumValue& value : model.enums[*field.type.index].values) {
      if (value.value == field.default_integer) return value.name;
    }
  }
  return std::to_string(field.default_integer);
}

}  // namespace rtpm::schema
