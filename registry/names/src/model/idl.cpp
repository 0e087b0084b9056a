#include "model/idl.hpp"

#include <utility>

namespace rtpm::names {
namespace {

using Builder = flatbuffers::FlatBufferBuilder;

template <class To, class Vector>
PropertyValue list_of(const Vector* items) {
  PropertyList list{predicate::type_of(predicate::Item(To{})), {}};
  for (flatbuffers::uoffset_t i = 0; items != nullptr && i < items->size(); ++i) {
    if constexpr (std::is_same_v<To, std::string>) {
      list.items.emplace_back(items->Get(i)->str());
    } else {
      list.items.emplace_back(static_cast<To>(items->Get(i)));
    }
  }
  return list;
}

std::optional<PropertyValue> value_of(const PropertyEntry& property) {
  switch (property.type()) {
    case ValueType::Bool:
      return PropertyValue(property.integer() != 0);
    case ValueType::Integer:
      return PropertyValue(property.integer());
    case ValueType::Real:
      return PropertyValue(property.real());
    case ValueType::Text:
      return PropertyValue(text_of(property.text()));
    case ValueType::Bools:
      return list_of<bool>(property.integers());
    case ValueType::Integers:
      return list_of<std::int64_t>(property.integers());
    case ValueType::Reals:
      return list_of<double>(property.reals());
    case ValueType::Texts:
      return list_of<std::string>(property.texts());
  }
  return std::nullopt;
}

/// The items as a vector of T.
template <class T>
std::vector<T> items_of(const PropertyList& list) {
  std::vector<T> items;
  for (const predicate::Item& item : list.items) {
    std::visit(
        [&](const auto& value) {
          if constexpr (std::is_convertible_v<decltype(value), T>) {
            items.push_back(static_cast<T>(value));
          }
        },
        item);
  }
  return items;
}

/// The fields of a table that a value fills.
struct Fields {
  std::int64_t integer = 0;
  double real = 0;
  flatbuffers::Offset<flatbuffers::String> text{};
  flatbuffers::Offset<flatbuffers::Vector<std::int64_t>> integers{};
  flatbuffers::Offset<flatbuffers::Vector<double>> reals{};
  flatbuffers::Offset<flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>> texts{};
};

Fields fields_of(Builder& builder, const PropertyValue& value) {
  Fields fields;
  switch (predicate::type_of(value)) {
    case PropertyType::kBool:
      fields.integer = std::get<bool>(value) ? 1 : 0;
      break;
    case PropertyType::kInteger:
      fields.integer = std::get<std::int64_t>(value);
      break;
    case PropertyType::kReal:
      fields.real = std::get<double>(value);
      break;
    case PropertyType::kText:
      fields.text = builder.CreateString(std::get<std::string>(value));
      break;
    case PropertyType::kBools:
    case PropertyType::kIntegers:
      fields.integers = builder.CreateVector(items_of<std::int64_t>(std::get<PropertyList>(value)));
      break;
    case PropertyType::kReals:
      fields.reals = builder.CreateVector(items_of<double>(std::get<PropertyList>(value)));
      break;
    case PropertyType::kTexts:
      fields.texts =
          builder.CreateVectorOfStrings(items_of<std::string>(std::get<PropertyList>(value)));
      break;
  }
  return fields;
}

flatbuffers::Offset<PropertyEntry> write(Builder& builder, const Property& property) {
  const auto name = builder.CreateString(property.name);
  flatbuffers::Offset<flatbuffers::String> unit{};
  if (!property.unit.empty()) unit = builder.CreateString(property.unit);
  const Fields fields = fields_of(builder, property.value);
  return CreatePropertyEntry(
      builder, name, static_cast<ValueType>(predicate::type_of(property.value)), fields.integer,
      fields.real, fields.text, fields.integers, fields.reals, fields.texts, unit);
}

}  // namespace

std::optional<std::vector<Property>> properties_of(const PropertyTables* tables) {
  std::vector<Property> properties;
  for (flatbuffers::uoffset_t i = 0; tables != nullptr && i < tables->size(); ++i) {
    const PropertyEntry& table = *tables->Get(i);
    auto value = value_of(table);
    if (!value) return std::nullopt;
    properties.push_back({text_of(table.name()), std::move(*value), text_of(table.unit())});
  }
  return properties;
}

flatbuffers::Offset<PropertyTables> write_properties(flatbuffers::FlatBufferBuilder& builder,
                                                     std::span<const Property> properties) {
  std::vector<flatbuffers::Offset<PropertyEntry>> tables;
  for (const Property& property : properties)
    tables.push_back(write(builder, property));
  return tables.empty() ? flatbuffers::Offset<PropertyTables>{} : builder.CreateVector(tables);
}

NameEntry entry_of(const Entry& entry, std::uint64_t stale_ns) {
  return {text_of(entry.name()),
          text_of(entry.url()),
          text_of(entry.interface()),
          duration_of(entry.lease_left_ns()),
          entry.revision(),
          properties_of(entry.properties()).value_or(std::vector<Property>{}),
          entry.is_permanent(),
          duration_of(stale_ns),
          text_of(entry.bound_from()),
          entry.is_of_other_host()};
}

}  // namespace rtpm::names
