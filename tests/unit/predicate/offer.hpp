#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/predicate/operand.hpp"
#include "rtpm/predicate/predicate.hpp"

namespace rtpm::predicate {

/// The properties of one offer.
class Offer final : public PropertySource {
 public:
  explicit Offer(std::vector<Property> properties) : properties_(std::move(properties)) {}
  [[nodiscard]] Operand find(std::string_view name) const noexcept override {
    for (const Property& property : properties_) {
      if (property.name == name) return operand_of(property.value);
    }
    return {};
  }
  /// The types, as a registry knows them from its names.
  [[nodiscard]] TypeOfProperty types() const {
    return [this](std::string_view name) -> std::optional<Type> {
      for (const Property& property : properties_) {
        if (property.name == name) return type_of(property.value);
      }
      return std::nullopt;
    };
  }

 private:
  std::vector<Property> properties_;
};

}  // namespace rtpm::predicate
