#pragma once

#include <cstddef>
#include <set>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The types reached from one or more tables, through fields, vectors and unions.
struct Reach {
  std::set<std::size_t> objects{};  ///< Indices in Model::objects.
  std::set<std::size_t> enums{};    ///< Indices in Model::enums.

  /// Adds the object `index` and everything that it reaches.
  void add(const Model& model, std::size_t index);
};

}  // namespace rtpm::schema
