#include "rtpm/file_store/json.hpp"

#include <utility>

#include "json_values.hpp"
#include "rtpm/base/nesting.hpp"

namespace rtpm::file_store {
namespace {

using names::PropertyType;
using names::PropertyValue;

template <class T>
Json json_of_value(const T& value) {
  return Json(value);
}
Json json_of_value(const names::PropertyList& list) {
  Json items = Json::array();
  for (const auto& item : list.items)
    items.push_back(std::visit([](const auto& held) { return Json(held); }, item));
  return items;
}

std::optional<predicate::Item> item_of(const Json& json, PropertyType type) {
  if (type == PropertyType::kBool && json.is_boolean()) return predicate::Item(json.get<bool>());
  if (type == PropertyType::kText && json.is_string()) {
    return predicate::Item(json.get<std::string>());
  }
  if (type == PropertyType::kReal && json.is_number()) return predicate::Item(json.get<double>());
  if (type == PropertyType::kInteger && json.is_number_integer()) {
    return predicate::Item(json.get<std::int64_t>());
  }
  return std::nullopt;
}

std::optional<PropertyValue> value_of(const Json& json, PropertyType type) {
  if (!predicate::is_list(type)) {
    auto item = item_of(json, type);
    if (!item) return std::nullopt;
    return std::visit([](auto&& held) { return PropertyValue(std::move(held)); }, std::move(*item));
  }
  if (!json.is_array()) return std::nullopt;
  names::PropertyList list{predicate::item_type(type), {}};
  for (const Json& each : json) {
    auto item = item_of(each, list.item_type);
    if (!item) return std::nullopt;
    list.items.push_back(std::move(*item));
  }
  return PropertyValue(std::move(list));
}

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

unexpected<SetupError> not_of_this_form(const std::string& what) {
  return setup_error("the input is no dump of a registry", what,
                     "give what `rtpm-registryd --dump` printed");
}

}  // namespace

Json json_of(const std::vector<names::Property>& properties) {
  Json list = Json::array();
  for (const names::Property& property : properties) {
    Json json{{"name", property.name},
              {"type", to_string(predicate::type_of(property.value))},
              {"value",
               std::visit([](const auto& value) { return json_of_value(value); }, property.value)}};
    if (!property.unit.empty()) json["unit"] = property.unit;
    list.push_back(std::move(json));
  }
  return list;
}

std::optional<std::vector<names::Property>> properties_of(const Json& json) {
  std::vector<names::Property> properties;
  if (json.is_null()) return properties;
  if (!json.is_array()) return std::nullopt;
  for (const Json& each : json) {
    if (!each.is_object()) return std::nullopt;
    const auto type = predicate::type_named(text_at(each, "type"));
    const auto value = each.find("value");
    if (!type || value == each.end()) return std::nullopt;
    auto read = value_of(*value, *type);
    if (!read) return std::nullopt;
    properties.push_back({text_at(each, "name"), std::move(*read), text_at(each, "unit")});
  }
  return properties;
}

std::string properties_to_json(const std::vector<names::Property>& properties) {
  return json_of(properties).dump();
}

std::optional<std::vector<names::Property>> properties_from_json(std::string_view text) {
  const Json json = parse_bounded_json<Json>(text);
  return json.is_discarded() ? std::nullopt : properties_of(json);
}

std::string to_json(const std::vector<names::StoredName>& stored) {
  Json list = Json::array();
  for (const names::StoredName& each : stored) {
    if (!each.is_permanent()) continue;
    list.push_back({{"name", each.name},
                    {"url", each.url},
                    {"interface", each.interface},
                    {"properties", json_of(each.properties)}});
  }
  return Json{{"version", 1}, {"names", std::move(list)}}.dump(2) + "\n";
}

expected<std::vector<names::StoredName>, SetupError> parse_json(std::string_view text,
                                                                names::Owner owner) {
  const Json json = parse_bounded_json<Json>(text);
  if (!json.is_object()) return not_of_this_form("it is no JSON object");
  if (!json.contains("version") || json["version"] != 1) {
    return not_of_this_form("its version is not 1");
  }
  const auto list = json.find("names");
  if (list == json.end() || !list->is_array()) return not_of_this_form("it has no list 'names'");
  std::vector<names::StoredName> stored;
  for (const Json& each : *list) {
    const std::string which = "entry " + std::to_string(stored.size() + 1) + " of 'names'";
    if (!each.is_object()) return not_of_this_form(which + " is no object");
    auto properties = properties_of(each.contains("properties") ? each["properties"] : Json());
    if (!properties) return not_of_this_form(which + " has properties of another form");
    stored.push_back({.name = text_at(each, "name"),
                      .url = text_at(each, "url"),
                      .interface = text_at(each, "interface"),
                      .owner = owner,
                      .properties = std::move(*properties)});
  }
  return stored;
}

}  // namespace rtpm::file_store
