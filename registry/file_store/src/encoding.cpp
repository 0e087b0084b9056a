#include "encoding.hpp"

#include <array>
#include <charconv>
#include <cstdint>
#include <utility>

namespace rtpm::file_store {
namespace {

using names::PropertyType;
using names::PropertyValue;
using predicate::Item;

// A property is "name \x1f unit \x1f type \x1f item \x1e item \x1e \x1d"; each item ends with \x1e.
constexpr char kFieldEnd = '\x1f';
constexpr char kItemEnd = '\x1e';
constexpr char kPropertyEnd = '\x1d';

void append(std::string& text, const Item& item) {
  std::array<char, 40> digits{};  // The shortest text that reads as the same number.
  char* end = digits.data();
  if (const auto* held = std::get_if<std::string>(&item)) {
    text += *held;
  } else if (const auto* truth = std::get_if<bool>(&item)) {
    text += *truth ? '1' : '0';
  } else if (const auto* integer = std::get_if<std::int64_t>(&item)) {
    end = std::to_chars(digits.data(), digits.data() + digits.size(), *integer).ptr;
  } else {
    end = std::to_chars(digits.data(), digits.data() + digits.size(), std::get<double>(item)).ptr;
  }
  text.append(digits.data(), end);
  text += kItemEnd;
}

template <class T>
std::optional<Item> number_of(std::string_view text) {
  T value{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value);
  if (read.ec != std::errc{} || read.ptr != end) return std::nullopt;
  return Item(value);
}

std::optional<Item> item_of(std::string_view text, PropertyType type) {
  switch (type) {
    case PropertyType::kBool:
      return text == "1" || text == "0" ? std::optional<Item>(Item(text == "1")) : std::nullopt;
    case PropertyType::kInteger:
      return number_of<std::int64_t>(text);
    case PropertyType::kReal:
      return number_of<double>(text);
    default:
      return Item(std::string(text));
  }
}

/// Removes and returns the text before `end`; also removes `end`.
std::optional<std::string_view> take(std::string_view& text, char end) {
  const std::size_t size = text.find(end);
  if (size == std::string_view::npos) return std::nullopt;
  const std::string_view taken = text.substr(0, size);
  text.remove_prefix(size + 1);
  return taken;
}

std::optional<PropertyValue> value_of(std::string_view items, PropertyType type) {
  const bool is_list = predicate::is_list(type);
  names::PropertyList list{is_list ? predicate::item_type(type) : type, {}};
  while (!items.empty()) {
    const auto text = take(items, kItemEnd);
    auto item = text ? item_of(*text, list.item_type) : std::nullopt;
    if (!item) return std::nullopt;
    list.items.push_back(std::move(*item));
  }
  if (is_list) return PropertyValue(std::move(list));
  if (list.items.size() != 1) return std::nullopt;
  return std::visit([](auto&& held) { return PropertyValue(std::move(held)); },
                    std::move(list.items.front()));
}

}  // namespace

std::string encode(const std::vector<names::Property>& properties) {
  std::string text;
  for (const names::Property& property : properties) {
    text += property.name + kFieldEnd + property.unit + kFieldEnd;
    text += static_cast<char>('0' + static_cast<int>(predicate::type_of(property.value)));
    text += kFieldEnd;
    std::visit(
        [&](const auto& value) {
          if constexpr (std::is_same_v<std::decay_t<decltype(value)>, names::PropertyList>) {
            for (const Item& item : value.items)
              append(text, item);
          } else {
            append(text, Item(value));
          }
        },
        property.value);
    text += kPropertyEnd;
  }
  return text;
}

std::optional<std::vector<names::Property>> decode(std::string_view text) {
  std::vector<names::Property> properties;
  while (!text.empty()) {
    const auto name = take(text, kFieldEnd);
    const auto unit = take(text, kFieldEnd);
    const auto type = take(text, kFieldEnd);
    const auto items = take(text, kPropertyEnd);
    const bool is_type = items && type->size() == 1 && type->front() >= '0' &&
                         type->front() < '0' + predicate::kTypeCount;
    if (!is_type) return std::nullopt;
    auto value = value_of(*items, static_cast<PropertyType>(type->front() - '0'));
    if (!value) return std::nullopt;
    properties.push_back({std::string(*name), std::move(*value), std::string(*unit)});
  }
  return properties;
}

}  // namespace rtpm::file_store
