#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

std::string short_name(const std::string& qualified_name) {
  return qualified_name.substr(qualified_name.rfind('.') + 1);
}

std::string namespace_of(const std::string& qualified_name) {
  const std::size_t dot = qualified_name.rfind('.');
  return dot == std::string::npos ? std::string{} : qualified_name.substr(0, dot);
}

std::string referred_name(const Model& model, const Type& type) {
  if (!type.index) return {};
  return type.has_object() ? model.objects[*type.index].name : model.enums[*type.index].name;
}

}  // namespace rtpm::schema
