#include "rows.hpp"

#include <algorithm>
#include <utility>

#include "numbers.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace rtpm::exports {
namespace {

using schema::BaseType;
using schema::Field;
using schema::Type;

/// Parts of a FlatBuffer may be shared, so a few bytes can be gigabytes of text.
constexpr std::size_t kTextSizeMax = std::size_t{1} << 26;

/// Follows the offset stored at `at`.
const std::byte* follow(const std::byte* at) {
  return at + load_le<std::uint32_t>(at);
}

/// The position of a table's field; nullptr if it is absent.
const std::byte* field_of(const std::byte* table, std::uint16_t slot) {
  const std::byte* vtable =
      table - static_cast<std::ptrdiff_t>(static_cast<std::int32_t>(load_le<std::uint32_t>(table)));
  const std::size_t at = 4 + 2 * std::size_t{slot};
  if (at + 2 > load_le<std::uint16_t>(vtable)) return nullptr;
  const std::uint16_t offset = load_le<std::uint16_t>(vtable + at);
  return offset == 0 ? nullptr : table + offset;
}

/// The bytes of the vector or text at `at`.
ConstBytes vector_at(const std::byte* at, std::size_t element_size) {
  const std::byte* vector = follow(at);
  return {vector + sizeof(std::uint32_t), load_le<std::uint32_t>(vector) * element_size};
}

std::string_view text_at(const std::byte* at) {
  const ConstBytes bytes = vector_at(at, 1);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void append_base64(std::string& text, ConstBytes bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = i; j < i + 3; ++j)
      group = group << 8 | (j < bytes.size() ? std::to_integer<std::uint32_t>(bytes[j]) : 0);
    const std::size_t digit_count = std::min<std::size_t>(bytes.size() - i, 3) + 1;
    for (std::size_t j = 0; j < 4; ++j)
      text += j < digit_count ? kDigits[group >> (18 - 6 * j) & 63] : '=';
  }
}

/// Writes values as JSON.
class Printer {
 public:
  Printer(const schema::Model& model, std::string& text) noexcept : model_(model), text_(text) {}

  [[nodiscard]] bool is_too_long() const noexcept { return text_.size() > kTextSizeMax; }

  void object(std::size_t index, const std::byte* at) {
    const schema::Object& type = model_.objects[index];
    char before = '{';
    for (const Field& field : type.fields) {
      if (is_too_long()) return;
      if (field.type.base == BaseType::kUnionType) continue;
      const std::byte* const value = type.is_struct ? at + field.offset : field_of(at, field.id);
      if (value == nullptr && (field.type.base > BaseType::kDouble || field.is_optional)) continue;
      text_ += before;
      before = ',';
      append_json_text(text_, field.name);
      text_ += ':';
      if (value == nullptr) {
        default_of(field);
      } else if (field.type.base == BaseType::kUnion) {
        member(field, at, value);
      } else {
        this->value(field.type, value, type.is_struct);
      }
    }
    text_ += before == '{' ? "{}" : "}";
  }

  /// A column's value inside a table.
  void table_value(const Field& field, const std::byte* table, const std::byte* at) {
    if (field.type.base == BaseType::kUnion) return member(field, table, at);
    value(field.type, at, false);
  }

  void default_of(const Field& field) {
    if (field.type.index) return enumeration(*field.type.index, field.default_integer);
    append_default(text_, field);
  }

  /// The name of an enumeration's value, or the number.
  void number(const Type& type, const std::byte* at) {
    if (type.index) return enumeration(*type.index, integer_at(type.innermost(), at));
    if (!is_finite_at(type.innermost(), at)) {
      text_ += "null";
    } else {
      append_number(text_, type.innermost(), at);
    }
  }

 private:
  void enumeration(std::size_t index, std::int64_t value) {
    const auto& values = model_.enums[index].values;
    const auto found = std::ranges::find(values, value, &schema::EnumValue::value);
    if (found == values.end()) {
      text_ += std::to_string(value);
    } else {
      append_json_text(text_, found->name);
    }
  }

  /// A union's value, whose type is the field before it.
  void member(const Field& field, const std::byte* table, const std::byte* at) {
    const std::byte* const kind = field_of(table, static_cast<std::uint16_t>(field.id - 1));
    const std::int64_t chosen = kind == nullptr ? 0 : std::to_integer<std::int64_t>(*kind);
    const auto& values = model_.enums[*field.type.index].values;
    const auto found = std::ranges::find(values, chosen, &schema::EnumValue::value);
    if (found == values.end() || !found->union_type.has_object()) {
      text_ += "null";
      return;
    }
    text_ += '{';
    append_json_text(text_, found->name);
    text_ += ':';
    object(*found->union_type.index, follow(at));
    text_ += '}';
  }

  void value(const Type& type, const std::byte* at, bool is_in_struct) {
    if (type.base == BaseType::kString) {
      append_json_text(text_, text_at(at));
    } else if (type.base == BaseType::kVector) {
      vector(type, at);
    } else if (type.base == BaseType::kArray) {
      elements(type, at, type.fixed_length);
    } else if (type.base == BaseType::kObject) {
      const bool is_inline = is_in_struct || model_.objects[*type.index].is_struct;
      object(*type.index, is_inline ? at : follow(at));
    } else if (type.base == BaseType::kUnion) {
      text_ += "null";  // In a vector, apart from its type.
    } else {
      number(type, at);
    }
  }

  void vector(const Type& type, const std::byte* at) {
    if (type.element == BaseType::kUint8 && !type.index) {
      text_ += '"';
      append_base64(text_, vector_at(at, 1));
      text_ += '"';
      return;
    }
    const std::byte* const data = follow(at);
    elements(type, data + sizeof(std::uint32_t), load_le<std::uint32_t>(data));
  }

  void elements(const Type& type, const std::byte* data, std::size_t count) {
    Type element = type;
    element.base = type.element;
    const bool is_struct = type.has_object() && model_.objects[*type.index].is_struct;
    const bool is_offset = element.base == BaseType::kString || (type.has_object() && !is_struct);
    const std::size_t size = is_struct   ? model_.objects[*type.index].byte_size
                             : is_offset ? sizeof(std::uint32_t)
                                         : size_of(element.base);
    text_ += '[';
    for (std::size_t i = 0; i < count && !is_too_long(); ++i) {
      if (i > 0) text_ += ',';
      value(element, data + i * size, false);
    }
    text_ += ']';
  }

  const schema::Model& model_;
  std::string& text_;
};

/// A column's place in a message.
struct Found {
  const std::byte* table = nullptr;  ///< The innermost table; nullptr if it is absent.
  const std::byte* at = nullptr;     ///< The value, or its struct; nullptr if absent.
};

Found find(const Column& column, const std::byte* root) {
  Found found{.table = root};
  for (std::size_t i = 0; i < column.slots.size(); ++i) {
    if (i > 0) found.table = found.at == nullptr ? nullptr : follow(found.at);
    if (found.table == nullptr) return {};
    found.at = field_of(found.table, column.slots[i]);
  }
  return found;
}

void append_number_cell(const schema::Model& model, const Column& column, const Found& found,
                        std::string& cell) {
  if (found.at == nullptr) {
    const bool has_default =
        found.table != nullptr && !column.is_in_struct && !column.field->is_optional;
    if (has_default) Printer(model, cell).default_of(*column.field);
  } else if (column.type.index) {
    Printer(model, cell).number(column.type, found.at + column.offset);
  } else {
    append_number(cell, column.type.base, found.at + column.offset);
  }
  std::erase(cell, '"');  // Around the name of an enumeration's value.
}

void append_cell(const schema::Model& model, const Column& column, const std::byte* root,
                 std::string& cell) {
  const Found found = find(column, root);
  if (column.kind == Column::Kind::kNumber) {
    append_number_cell(model, column, found, cell);
  } else if (found.at != nullptr && column.kind == Column::Kind::kText) {
    cell = text_at(found.at);
  } else if (found.at != nullptr) {
    Printer(model, cell).table_value(*column.field, found.table, found.at);
  }
}

}  // namespace

void append_json_text(std::string& json, std::string_view text) {
  json += '"';
  for (const char c : printable_lines(text)) {
    if (c == '"' || c == '\\') json += '\\';
    if (c == '\n') {
      json += "\\n";
    } else if (c == '\t') {
      json += "\\t";
    } else {
      json += c;
    }
  }
  json += '"';
}

expected<std::unique_ptr<Rows>, std::string> Rows::make(const recording::Schema& schema) {
  if (schema.encoding != "flatbuffer")
    return unexpected{"its schema is in the encoding '" + schema.encoding + "'"};
  const auto compiled = schema::compile_binary(
      {reinterpret_cast<const std::uint8_t*>(schema.data.data()), schema.data.size()}, schema.name);
  if (!compiled.model)
    return unexpected{"its schema can't be read: " + compiled.errors.front().message};
  std::string error;
  auto dynamic = schema::Dynamic::make(schema::schema_text(*compiled.model), error);
  if (dynamic == nullptr) return unexpected{"its schema can't be read: " + error};
  const auto& objects = dynamic->model().objects;
  const auto found = std::ranges::find(objects, schema.name, &schema::Object::name);
  if (found == objects.end() || found->is_struct)
    return unexpected{"its schema has no table " + schema.name};
  const auto table = static_cast<std::size_t>(found - objects.begin());
  auto columns = columns_of(dynamic->model(), table);
  if (!columns) return unexpected{std::string("its messages have too many values")};
  // Recorded messages are tables, also those that are bare structs on the wire.
  const schema::Payload payload{.kind = schema::PayloadKind::kTable, .table = table};
  return std::unique_ptr<Rows>(new Rows(std::move(dynamic), payload, *std::move(columns)));
}

void Rows::keep(const std::vector<bool>& is_kept) {
  std::vector<Column> kept;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (is_kept[i]) kept.push_back(std::move(columns_[i]));
  }
  columns_ = std::move(kept);
}

bool Rows::read(ConstBytes message, std::vector<std::string>& cells) {
  const auto table = dynamic_->as_table(payload_, message);
  if (!table) return false;
  cells.resize(columns_.size());
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    cells[i].clear();
    append_cell(dynamic_->model(), columns_[i], follow(table->data()), cells[i]);
  }
  return true;
}

std::string Rows::read_bytes(ConstBytes message, std::string_view column) {
  const auto named = std::ranges::find(columns_, column, &Column::name);
  if (named == columns_.end()) return {};
  const bool is_bytes = named->kind == Column::Kind::kText ||
                        (named->type.base == BaseType::kVector && !named->type.index &&
                         named->type.element == BaseType::kUint8);
  const auto table = dynamic_->as_table(payload_, message);
  if (!is_bytes || !table) return {};
  const Found found = find(*named, follow(table->data()));
  return found.at == nullptr ? std::string() : std::string(text_at(found.at));
}

bool Rows::read_json(ConstBytes message, std::string& json) {
  const auto table = dynamic_->as_table(payload_, message);
  if (!table) return false;
  json.clear();
  Printer printer(dynamic_->model(), json);
  printer.object(payload_.table, follow(table->data()));
  return !printer.is_too_long();
}

}  // namespace rtpm::exports
