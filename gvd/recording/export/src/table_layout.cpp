#include "table_layout.hpp"

#include <algorithm>

#include "numbers.hpp"

namespace rtpm::exports {
namespace {

using schema::BaseType;
using schema::Field;
using schema::Type;

/// A file of more columns is of no use, and a schema may come from any program.
constexpr std::size_t kColumnCountMax = 10'000;

class Layout {
 public:
  explicit Layout(const schema::Model& model) noexcept : model_(model) {}

  void table(std::size_t index, const Column& above) {
    open_.push_back(index);
    const schema::Object& object = model_.objects[index];
    const bool is_one_struct = above.slots.empty() && schema::payload_of(model_, index).kind ==
                                                          schema::PayloadKind::kStruct;
    for (const Field& field : object.fields) {
      // A union's type is shown with the union.
      if (field.type.base == BaseType::kUnionType) continue;
      Column column = below(above, field);
      if (is_one_struct) column.name.clear();
      column.slots.push_back(field.id);
      column.field = &field;
      table_field(column);
    }
    open_.pop_back();
  }
  [[nodiscard]] std::optional<std::vector<Column>> take() {
    if (columns_.size() > kColumnCountMax) return std::nullopt;
    return std::move(columns_);
  }

 private:
  static Column below(const Column& above, const Field& field) {
    Column column = above;
    if (!column.name.empty()) column.name += '.';
    column.name += field.name;
    if (!field.unit.empty()) column.unit = field.unit;
    column.type = field.type;
    return column;
  }

  void table_field(Column& column) {
    const Type& type = column.type;
    if (type.base == BaseType::kString) return add(column, Column::Kind::kText);
    if (type.base == BaseType::kVector || type.base == BaseType::kUnion)
      return add(column, Column::Kind::kJson);
    if (type.base != BaseType::kObject) return add(column, Column::Kind::kNumber);
    if (model_.objects[*type.index].is_struct) {
      column.is_in_struct = true;
      return structure(*type.index, column);
    }
    if (std::ranges::count(open_, *type.index) > 0) return add(column, Column::Kind::kJson);
    table(*type.index, column);
  }

  void structure(std::size_t index, const Column& above) {
    for (const Field& field : model_.objects[index].fields) {
      Column column = below(above, field);
      column.offset += field.offset;
      struct_field(column);
    }
  }

  void struct_field(Column& column) {
    const Type type = column.type;
    if (type.base != BaseType::kArray) return struct_value(column);
    const std::string name = column.name;
    const std::size_t size =
        type.has_object() ? model_.objects[*type.index].byte_size : size_of(type.element);
    column.type.base = type.element;
    for (std::size_t i = 0; i < type.fixed_length && columns_.size() <= kColumnCountMax; ++i) {
      column.name = name + "[" + std::to_string(i) + "]";
      struct_value(column);
      column.offset += size;
    }
  }

  void struct_value(Column& column) {
    if (column.type.base == BaseType::kObject) return structure(*column.type.index, column);
    add(column, Column::Kind::kNumber);
  }

  void add(Column& column, Column::Kind kind) {
    if (columns_.size() > kColumnCountMax) return;
    column.kind = kind;
    columns_.push_back(column);
  }

  const schema::Model& model_;
  std::vector<std::size_t> open_{};  ///< The tables on the way.
  std::vector<Column> columns_{};
};

}  // namespace

std::optional<std::vector<Column>> columns_of(const schema::Model& model, std::size_t table) {
  Layout layout(model);
  layout.table(table, {});
  return layout.take();
}

}  // namespace rtpm::exports
