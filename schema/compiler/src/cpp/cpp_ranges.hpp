#pragma once

#include <string>

#include "model/ranged_types.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema::cpp {

/// Generates the `rtpm_range` checks that a skeleton runs before a method.
/// @ownership refers to the model, which must outlive it
class Ranges {
 public:
  explicit Ranges(const Model& model) : model_(model), types_(model) {}

  /// Whether a request contains numbers with a range, at any depth.
  [[nodiscard]] bool are_in(const Payload& request) const { return types_.has(request); }
  /// Functions `rtpm_in_range(value, check)` in an anonymous namespace, one for each type with
  /// ranges that is reachable from requests; empty if there is no such type.
  [[nodiscard]] std::string functions() const;

 private:
  [[nodiscard]] std::string field_check(const Object& object, const Field& field) const;
  [[nodiscard]] std::string definition(const Object& object) const;
  [[nodiscard]] std::string definition(const Enum& enumeration) const;

  const Model& model_;
  RangedTypes types_;
};

}  // namespace rtpm::schema::cpp
