#include "model/reach.hpp"

#include <vector>

namespace rtpm::schema {

void Reach::add(const Model& model, std::size_t index) {
  std::vector<std::size_t> open{index};
  while (!open.empty()) {
    const std::size_t at = open.back();
    open.pop_back();
    if (!objects.insert(at).second) continue;
    for (const Field& field : model.objects[at].fields) {
      const Type& type = field.type;
      if (!type.index) continue;
      if (type.has_object()) {
        open.push_back(*type.index);
      } else if (enums.insert(*type.index).second) {
        for (const EnumValue& value : model.enums[*type.index].values) {
          if (value.union_type.base == BaseType::kObject) open.push_back(*value.union_type.index);
        }
      }
    }
  }
}

}  // namespace rtpm::schema
