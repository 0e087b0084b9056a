#pragma once

#include <cstddef>
#include <set>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The types that have a number with an `rtpm_range`, at any depth.
/// @ownership refers to the model, which must outlive it
class RangedTypes {
 public:
  explicit RangedTypes(const Model& model);

  [[nodiscard]] bool has(const Payload& payload) const;
  [[nodiscard]] bool has(const Type& type) const;
  [[nodiscard]] bool has_object(std::size_t index) const { return objects_.contains(index); }
  [[nodiscard]] bool has_union(std::size_t index) const { return unions_.contains(index); }

 private:
  [[nodiscard]] bool has(const Object& object) const;
  [[nodiscard]] bool has(const Enum& enumeration) const;

  const Model& model_;
  std::set<std::size_t> objects_{};
  std::set<std::size_t> unions_{};
};

}  // namespace rtpm::schema
