#include "model/properties.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>

#include "model/name.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::names {
namespace {

constexpr std::array<std::string_view, 4> kBuiltIn{"host", "interface", "name", "url"};
/// Words that the grammar of predicates reserves.
constexpr std::array<std::string_view, 10> kReserved{"FALSE", "TRUE", "and", "exist", "exists",
                                                     "false", "in",   "not", "or",    "true"};

bool is_property_name(std::string_view name) {
  if (name.size() > kPropertyNameSizeMax || !is_interface(name)) return false;
  return !is_built_in(name) && std::ranges::find(kReserved, name) == kReserved.end();
}

bool is_text(std::string_view text, std::size_t size_max) {
  return text.size() <= size_max && printable(text, kShownWhole) == text;
}

bool is_item(const predicate::Item& item) {
  if (const auto* text = std::get_if<std::string>(&item)) {
    return is_text(*text, kPropertyTextSizeMax);
  }
  const auto* const real = std::get_if<double>(&item);
  return real == nullptr || std::isfinite(*real);
}

bool is_value(const PropertyValue& value) {
  const auto* const list = std::get_if<PropertyList>(&value);
  if (list == nullptr) {
    const auto* const text = std::get_if<std::string>(&value);
    const auto* const real = std::get_if<double>(&value);
    return text != nullptr ? is_text(*text, kPropertyTextSizeMax)
                           : real == nullptr || std::isfinite(*real);
  }
  return list->items.size() <= kPropertyListSizeMax &&
         std::ranges::all_of(list->items, [&](const predicate::Item& item) {
           return predicate::type_of(item) == list->item_type && is_item(item);
         });
}

std::size_t size_of(const predicate::Item& item) noexcept {
  const auto* const text = std::get_if<std::string>(&item);
  return sizeof(std::int64_t) + (text == nullptr ? 0 : text->size());
}

std::size_t size_of(const PropertyValue& value) noexcept {
  const auto* const list = std::get_if<PropertyList>(&value);
  if (list != nullptr) {
    std::size_t size = sizeof(std::int64_t);
    for (const predicate::Item& item : list->items)
      size += size_of(item);
    return size;
  }
  const auto* const text = std::get_if<std::string>(&value);
  return sizeof(std::int64_t) + (text == nullptr ? 0 : text->size());
}

/// The host of rtpm://host:port/path.
std::string_view host_of(std::string_view url) noexcept {
  const std::size_t scheme = url.find("://");
  if (scheme == std::string_view::npos) return {};
  url.remove_prefix(scheme + 3);
  url = url.substr(0, url.find('/'));
  return url.substr(0, url.rfind(':'));
}

}  // namespace

std::optional<std::size_t> first_bad_property(std::span<const Property> properties) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < properties.size(); ++i) {
    const Property& property = properties[i];
    const bool is_good = i < kPropertyCountMax && is_property_name(property.name) &&
                         is_text(property.unit, kPropertyUnitSizeMax) && is_value(property.value) &&
                         names.insert(property.name).second;
    if (!is_good) return i;
  }
  return std::nullopt;
}

std::size_t byte_count(std::span<const Property> properties) noexcept {
  std::size_t count = 0;
  for (const Property& property : properties)
    count += property.name.size() + property.unit.size() + size_of(property.value);
  return count;
}

bool is_built_in(std::string_view name) noexcept {
  return std::ranges::find(kBuiltIn, name) != kBuiltIn.end();
}

predicate::Operand RecordProperties::find(std::string_view name) const noexcept {
  for (const Property& property : record_.properties) {
    if (property.name == name) return predicate::operand_of(property.value);
  }
  if (name == "name") return std::string_view(record_.name);
  if (name == "url") return std::string_view(record_.url);
  if (name == "interface") return std::string_view(record_.interface);
  if (name == "host") return host_of(record_.url);
  return {};
}

}  // namespace rtpm::names
