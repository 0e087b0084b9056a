#include "model/interface_index.hpp"

#include <algorithm>

#include "model/record.hpp"

namespace rtpm::names {

void InterfaceIndex::add(const Record& record) {
  Interface& interface = interfaces_[record.interface];
  interface.records.emplace(record.name, &record);
  for (const Property& property : record.properties) {
    TypeCounts& counts = interface.properties[property.name];
    ++counts[static_cast<std::size_t>(predicate::type_of(property.value))];
  }
}

void InterfaceIndex::remove(const Record& record) {
  const auto found = interfaces_.find(record.interface);
  if (found == interfaces_.end()) return;
  Interface& interface = found->second;
  interface.records.erase(record.name);
  for (const Property& property : record.properties) {
    const auto counts = interface.properties.find(property.name);
    --counts->second[static_cast<std::size_t>(predicate::type_of(property.value))];
    const auto is_none = [](std::size_t count) { return count == 0; };
    if (std::ranges::all_of(counts->second, is_none)) interface.properties.erase(counts);
  }
  if (interface.records.empty()) interfaces_.erase(found);
}

std::optional<PropertyType> InterfaceIndex::type_of(std::string_view interface,
                                                    std::string_view property) const {
  TypeCounts counts{};
  for_each_interface(interface, [&](const std::string&, const Interface& held) {
    const auto found = held.properties.find(property);
    if (found == held.properties.end()) return;
    for (std::size_t i = 0; i < counts.size(); ++i)
      counts[i] += found->second[i];
  });
  const auto is_some = [](std::size_t count) { return count > 0; };
  if (std::ranges::count_if(counts, is_some) != 1) return std::nullopt;
  return static_cast<PropertyType>(std::ranges::find_if(counts, is_some) - counts.begin());
}

bool InterfaceIndex::has(std::string_view interface, std::string_view property) const {
  bool has_it = false;
  for_each_interface(interface, [&](const std::string&, const Interface& held) {
    has_it = has_it || held.properties.contains(property);
  });
  return has_it;
}

std::vector<std::string> InterfaceIndex::properties_of(std::string_view interface) const {
  std::set<std::string> properties;
  for_each_interface(interface, [&](const std::string&, const Interface& held) {
    for (const auto& [name, counts] : held.properties)
      properties.insert(name);
  });
  return {properties.begin(), properties.end()};
}

std::vector<std::string> InterfaceIndex::interfaces() const {
  std::vector<std::string> interfaces;
  for (const auto& [name, held] : interfaces_)
    interfaces.push_back(name);
  return interfaces;
}

std::vector<const Record*> InterfaceIndex::all_in_order() const {
  std::vector<const Record*> all;
  for (const auto& [interface, held] : interfaces_) {
    for (const auto& [name, record] : held.records)
      all.push_back(record);
  }
  std::ranges::sort(all, [](const Record* a, const Record* b) { return a->name < b->name; });
  return all;
}

}  // namespace rtpm::names
