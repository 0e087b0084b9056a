#pragma once

#include <cstdint>
#include <string_view>
#include <variant>

#include "rtpm/predicate/value.hpp"

namespace rtpm::predicate {

/// A value during evaluation of a predicate; std::monostate if undefined.
/// @ownership refers to the property's or the predicate's text or list
using Operand =
    std::variant<std::monostate, bool, std::int64_t, double, std::string_view, const List*>;

[[nodiscard]] Operand operand_of(const Value& value) noexcept;

/// The properties that a predicate is evaluated on.
class PropertySource {
 public:
  PropertySource() = default;
  PropertySource(const PropertySource&) = delete;
  PropertySource& operator=(const PropertySource&) = delete;
  virtual ~PropertySource() = default;
  /// The property's value; std::monostate if there is no such property.
  [[nodiscard]] virtual Operand find(std::string_view name) const noexcept = 0;
};

}  // namespace rtpm::predicate
