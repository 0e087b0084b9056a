#include "model/spelling.hpp"

#include <array>
#include <cstddef>

namespace rtpm::schema {

std::string_view spelling_of(BaseType type) noexcept {
  constexpr std::array<std::string_view, 18> kNames{
      "none",  "union_type", "bool",  "int8",   "uint8",  "int16",  "uint16", "int32", "uint32",
      "int64", "uint64",     "float", "double", "string", "vector", "object", "union", "array"};
  const auto index = static_cast<std::size_t>(type);
  return index < kNames.size() ? kNames[index] : "unknown";
}

std::string_view spelling_of(PayloadKind kind) noexcept {
  switch (kind) {
    case PayloadKind::kEmpty:
      return "empty";
    case PayloadKind::kStruct:
      return "struct";
    case PayloadKind::kTable:
      break;
  }
  return "table";
}

std::string_view spelling_of(OnewayLevel level) noexcept {
  switch (level) {
    case OnewayLevel::kSent:
      return "sent";
    case OnewayLevel::kReceived:
      return "received";
    case OnewayLevel::kDone:
      break;
  }
  return "done";
}

std::string_view spelling_of(PriorityModel model) noexcept {
  return model == PriorityModel::kServerDeclared ? "server_declared" : "client_propagated";
}

}  // namespace rtpm::schema
