#include "laboratory/document.hpp"

#include <toml++/toml.h>

#include <algorithm>
#include <utility>

#include "laboratory/toml_nesting.hpp"
#include "rtpm/base/nesting.hpp"

namespace rtpm::laboratory {
namespace {

Position position_of(const toml::source_region& source) {
  return {source.begin.line, source.begin.column};
}

Value value_of(const toml::node& node);

Value list_of(const toml::array& array) {
  Value list{.kind = Value::Kind::kList};
  for (const toml::node& item : array)
    list.items.push_back(value_of(item));
  return list;
}

Value table_of(const toml::table& table) {
  Value result{.kind = Value::Kind::kTable};
  for (const auto& [key, node] : table) {
    Value value = value_of(node);
    value.key = key.str();
    value.key_position = position_of(key.source());
    result.items.push_back(std::move(value));
  }
  return result;
}

const char* kind_of(const toml::node& node) {
  return node.is_floating_point() ? "a number with a fraction" : "a date or a time of day";
}

Value value_of(const toml::node& node) {
  Value value;
  if (const toml::table* const table = node.as_table()) {
    value = table_of(*table);
  } else if (const toml::array* const array = node.as_array()) {
    value = list_of(*array);
  } else if (const auto* const text = node.as_string()) {
    value = {.kind = Value::Kind::kText, .text = text->get()};
  } else if (const auto* const integer = node.as_integer()) {
    value = {.kind = Value::Kind::kInteger, .integer = integer->get()};
  } else if (const auto* const boolean = node.as_boolean()) {
    value = {.kind = Value::Kind::kBool, .boolean = boolean->get()};
  } else {
    value.text = kind_of(node);
  }
  value.position = position_of(node.source());
  return value;
}

}  // namespace

const Value* Value::find(std::string_view wanted) const {
  const auto found = std::ranges::find(items, wanted, &Value::key);
  return found == items.end() ? nullptr : &*found;
}

std::string Value::kind_text() const {
  switch (kind) {
    case Kind::kText:
      return "the text \"" + text + "\"";
    case Kind::kInteger:
      return "the number " + std::to_string(integer);
    case Kind::kBool:
      return boolean ? "true" : "false";
    case Kind::kList:
      return "a list";
    case Kind::kTable:
      return "a table";
    case Kind::kOther:
      break;
  }
  return text;
}

expected<Value, Mistake> parse_document(std::string_view text) {
  if (const auto deep = toml_nested_beyond(text, kNestingMax)) {
    return unexpected{Mistake{*deep, "tables, keys and lists nest deeper than 64", {}}};
  }
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    const toml::parse_error& error = parsed.error();
    return unexpected{Mistake{position_of(error.source()), std::string(error.description()), {}}};
  }
  return table_of(parsed.table());
}

}  // namespace rtpm::laboratory
