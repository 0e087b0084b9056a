#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/property.hpp"

namespace rtpm::names {

struct Record;

/// The names of each interface, and the types of their properties.
/// @ownership refers to records, which must not move until they are removed
class InterfaceIndex {
 public:
  void add(const Record& record);
  void remove(const Record& record);

  /// Visits names in alphabetical order; all names if the interface is empty.
  template <class Function>
  void for_each(std::string_view interface, Function function) const {
    if (!interface.empty()) {
      const auto found = interfaces_.find(interface);
      if (found == interfaces_.end()) return;
      for (const auto& [name, record] : found->second.records)
        function(*record);
      return;
    }
    for (const Record* record : all_in_order())
      function(*record);
  }

  /// The common type of a property in all names of the interface that have it; nullopt if types
  /// differ, or no name has it.
  [[nodiscard]] std::optional<PropertyType> type_of(std::string_view interface,
                                                    std::string_view property) const;
  [[nodiscard]] bool has(std::string_view interface, std::string_view property) const;
  /// The properties of the interface's names.
  [[nodiscard]] std::vector<std::string> properties_of(std::string_view interface) const;
  /// The interfaces that have names.
  [[nodiscard]] std::vector<std::string> interfaces() const;

 private:
  /// How many names have a property of each type.
  using TypeCounts = std::array<std::size_t, predicate::kTypeCount>;
  struct Interface {
    std::map<std::string_view, const Record*> records{};
    std::map<std::string, TypeCounts, std::less<>> properties{};
  };

  template <class Function>
  void for_each_interface(std::string_view interface, Function function) const {
    for (const auto& [name, held] : interfaces_) {
      if (interface.empty() || interface == name) function(name, held);
    }
  }
  [[nodiscard]] std::vector<const Record*> all_in_order() const;

  std::map<std::string, Interface, std::less<>> interfaces_{};
};

}  // namespace rtpm::names
