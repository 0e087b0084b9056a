#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emit/name_scope.hpp"
#include "emit/prose.hpp"
#include "model/event_fields.hpp"
#include "model/verify_limits.hpp"
#include "model/words.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "typescript/typescript_names.hpp"
#include "typescript/typescript_writer.hpp"

// Structs, tables and events.
namespace rtpm::schema::typescript {
namespace {

std::string place(const std::string& base, std::size_t offset) {
  return offset == 0 ? base : base + " + " + std::to_string(offset);
}

/// "Float64" of DataView's methods getFloat64() and setFloat64().
std::string view_suffix(BaseType base) {
  if (base == BaseType::kBool) return "Uint8";
  if (base == BaseType::kInt64) return "BigInt64";
  if (base == BaseType::kUint64) return "BigUint64";
  std::string name = accessor(base);
  name.front() = static_cast<char>(name.front() - 'a' + 'A');
  return name;
}

std::string read_one(const Model& model, const Type& type, const std::string& at) {
  if (type.has_object()) return codec(model, type) + ".read(view, " + at + ')';
  const BaseType base = type.innermost();
  return "view.get" + view_suffix(base) + '(' + at + (size_of(base) > 1 ? ", true)" : ")") +
         (base == BaseType::kBool ? " !== 0" : "");
}

std::string write_one(const Model& model, const Type& type, const std::string& at,
                      const std::string& value) {
  if (type.has_object()) return codec(model, type) + ".write(view, " + at + ", " + value + ')';
  const BaseType base = type.innermost();
  const bool is_real = base == BaseType::kFloat || base == BaseType::kDouble;
  const std::string checked =
      base == BaseType::kBool
          ? value + " ? 1 : 0"
          : "rtpm.scalars." + (is_real ? "real" : accessor(base)) + '(' + value + ')';
  return "view.set" + view_suffix(base) + '(' + at + ", " + checked +
         (size_of(base) > 1 ? ", true)" : ")");
}

std::string read_member(const Model& model, const Field& field) {
  const std::string at = place("at", field.offset);
  if (!field.type.is_many()) return read_one(model, field.type, at);
  const std::string count = std::to_string(field.type.fixed_length);
  if (const std::string numbers = numbers_type(field.type.element); !numbers.empty()) {
    return "rtpm.readNumbers(view, " + at + ", " + count + ", " + numbers + ')';
  }
  const std::size_t step = field.type.has_object() ? model.objects[*field.type.index].byte_size : 1;
  return "Array.from({ length: " + count + " }, (_, i) => " +
         read_one(model, field.type, at + " + " + std::to_string(step) + " * i") + ')';
}

std::string write_member(const Model& model, const Field& field) {
  const std::string at = place("at", field.offset);
  const std::string value = "value." + member(field.name);
  if (!field.type.is_many()) return "      " + write_one(model, field.type, at, value) + ";\n";
  std::string text = "      rtpm.scalars.count(" + value + ".length, " +
                     std::to_string(field.type.fixed_length) + ");\n";
  if (!numbers_type(field.type.element).empty()) {
    return text + "      rtpm.writeNumbers(view, " + at + ", " + value + ");\n";
  }
  const std::size_t step = field.type.has_object() ? model.objects[*field.type.index].byte_size : 1;
  return text + "      " + value + ".forEach((one, i) => {\n        " +
         write_one(model, field.type, at + " + " + std::to_string(step) + " * i", "one") +
         ";\n      });\n";
}

bool is_scalar(const Type& type) noexcept {
  return type.base >= BaseType::kBool && type.base <= BaseType::kDouble;
}

bool is_struct_field(const Model& model, const Field& field) {
  return field.type.base == BaseType::kObject && model.objects[*field.type.index].is_struct;
}

std::string slot(const Field& field, int difference = 0) {
  return std::to_string(static_cast<int>(field.id) + difference);
}

std::string list_function(const Model& model, const Type& type) {
  if (type.has_object()) return model.objects[*type.index].is_struct ? "structs" : "tables";
  if (type.element == BaseType::kUnion) return "unions";
  return type.element == BaseType::kString ? "strings" : "bools";
}

std::string read_slot(const Model& model, const Field& field) {
  const std::string place = "(at, " + slot(field);
  if (is_scalar(field.type)) {
    return "reader." + accessor(field.type.base) + place + ", " +
           (field.is_optional ? "undefined" : default_value(model, field)) + ')';
  }
  const std::string required = field.is_required ? ", true)" : ", false)";
  if (field.type.base == BaseType::kString) return "reader.string" + place + required;
  if (field.type.is_many()) {
    if (const std::string numbers = numbers_type(field.type.element); !numbers.empty()) {
      return "reader.numbers" + place + ", " + numbers + required;
    }
    return "reader." + list_function(model, field.type) + place +
           (field.type.index ? ", " + codec(model, field.type) : "") + required;
  }
  const std::string kind = field.type.base == BaseType::kUnion ? "Union"
                           : is_struct_field(model, field)     ? "Struct"
                                                               : "Table";
  std::string function = "required" + kind;
  if (!field.is_required) function = emit::camel(kind);
  return "reader." + function + place + ", " + codec(model, field.type) + ')';
}

/// Adds the field, or the offset to it, to the open table.
std::string write_inline(const Model& model, const Field& field) {
  const std::string value = "value." + member(field.name);
  if (is_scalar(field.type)) {
    return "      writer." + accessor(field.type.base) + '(' + slot(field) + ", " + value + ", " +
           (field.is_optional ? "undefined" : default_value(model, field)) + ");\n";
  }
  if (is_struct_field(model, field)) {
    const std::string name = field.is_required ? ", " + literal(field.name) : "";
    return std::string("      writer.") + (field.is_required ? "requiredStruct(" : "struct(") +
           slot(field) + name + ", " + codec(model, field.type) + ", " + value + ");\n";
  }
  const bool is_sized = field.type.is_many() || field.type.base == BaseType::kString;
  const std::string presence = value + (is_sized ? ".length !== 0" : " !== undefined");
  std::string text;
  if (field.type.innermost() == BaseType::kUnion) {
    if (field.type.is_many()) {
      text = "      const types" + slot(field) + " = writer.reference(" + slot(field, -1) + ", " +
             (field.is_required ? "true" : presence) + ");\n";
    } else {
      text = "      writer.uint8(" + slot(field, -1) + ", " + value + " && " +
             codec(model, field.type) + ".typeOf(" + value + "), undefined);\n";
    }
  }
  const std::string reference =
      field.is_required
          ? "required(" + slot(field) + ", " + literal(field.name) + ", " + value + ')'
          : "reference(" + slot(field) + ", " + presence + ')';
  return text + "      const slot" + slot(field) + " = writer." + reference + ";\n";
}

/// Writes what the field's offset leads to; empty for a field without one.
std::string write_behind(const Model& model, const Field& field) {
  const Type& type = field.type;
  if (is_scalar(type) || is_struct_field(model, field)) return {};
  std::string arguments = "slot" + slot(field) + ", ";
  std::string function = type.base == BaseType::kString  ? "string"
                         : type.base == BaseType::kUnion ? "union"
                                                         : "table";
  bool has_codec = type.index.has_value();
  if (type.is_many()) {
    const bool is_numbers = !numbers_type(type.element).empty();
    function = is_numbers ? "numbers" : list_function(model, type);
    has_codec = has_codec && !is_numbers;
    if (type.element == BaseType::kUnion) arguments.insert(0, "types" + slot(field) + ", ");
  }
  return "      writer." + function + '(' + arguments +
         (has_codec ? codec(model, type) + ", " : "") + "value." + member(field.name) + ");\n";
}

/// A field of of(): the given one or its default.
std::string made_field(const Model& model, const Field& field) {
  const std::string given = "fields." + member(field.name);
  std::string absent;
  if (is_scalar(field.type)) {
    if (!field.is_optional) absent = default_value(model, field);
  } else if (field.type.is_many()) {
    const std::string numbers = numbers_type(field.type.element);
    absent = numbers.empty() ? "[]" : "new " + numbers + "(0)";
  } else if (field.type.base == BaseType::kString) {
    absent = "\"\"";
  }
  return "    " + member(field.name) + ": " + given +
         (absent.empty() || field.is_required ? "" : " ?? " + absent) + ",\n";
}

std::string event_default(const Field& field) {
  if (field.type.base != BaseType::kFloat && field.type.base != BaseType::kDouble) {
    return (is_unsigned(field.type.base)
                ? std::to_string(static_cast<std::uint64_t>(field.default_integer))
                : std::to_string(field.default_integer)) +
           'n';
  }
  if (std::isnan(field.default_real)) return "NaN";
  if (std::isinf(field.default_real)) return field.default_real < 0 ? "-Infinity" : "Infinity";
  return number_text(field.default_real);
}

std::string event_field(const EventField& field) {
  std::vector<std::string> slots;
  for (const std::uint16_t number : field.slots)
    slots.push_back(std::to_string(number));
  const int type = static_cast<int>(field.type) - static_cast<int>(BaseType::kBool);
  return "    { name: " + literal(field.name) + ", type: " + std::to_string(type) + ", slots: [" +
         emit::joined(slots, ", ") + "], offset: " + std::to_string(field.offset) +
         (field.slots.empty() ? "" : ", defaultValue: " + event_default(*field.field)) + " },\n";
}

/// The names of the numbers that filters can read.
std::string event_type(const std::string& payload, const std::vector<std::string>& names,
                       std::size_t column) {
  const std::string one_line = "rtpm.EventType<" + payload + ", " +
                               (names.empty() ? "never" : emit::joined(names, " | ")) + '>';
  if (column + one_line.size() + 4 <= emit::kColumnMax) return one_line;
  return "rtpm.EventType<\n  " + payload + ",\n  | " + emit::joined(names, "\n  | ") + "\n>";
}

}  // namespace

std::string struct_text(const Model& model, const Object& object) {
  const std::string name = type_name(model, object.name);
  std::string reads;
  std::string writes;
  for (const Field& field : object.fields) {
    reads += "      " + member(field.name) + ": " + read_member(model, field) + ",\n";
    writes += write_member(model, field);
  }
  return fields_text(model, object) + "export const " + name +
         ": { readonly codec: rtpm.StructCodec<" + name + "> } = {\n  codec: rtpm.structCodec(\n" +
         "    " + literal(object.name) + ",\n    " + std::to_string(object.byte_size) + ",\n    " +
         std::to_string(object.alignment) + ",\n    (view, at) => ({\n" + reads +
         "    }),\n    (view, at, value) => {\n" + writes + "    },\n  ),\n};\n";
}

std::string table_text(const Model& model, std::size_t index) {
  const Object& object = model.objects[index];
  const std::string name = type_name(model, object.name);
  std::string reads;
  std::string inlines;
  std::string behind;
  std::string made;
  std::vector<std::string> required;
  std::size_t slot_count = 0;
  for (const Field& field : object.fields) {
    slot_count = std::max<std::size_t>(slot_count, field.id + 1U);
    if (!is_shown(field)) continue;
    reads += "      " + member(field.name) + ": " + read_slot(model, field) + ",\n";
    inlines += write_inline(model, field);
    behind += write_behind(model, field);
    made += made_field(model, field);
    if (field.is_required) required.push_back(literal(member(field.name)));
  }
  const std::string given = "rtpm.Given<" + name + ", " +
                            (required.empty() ? "never" : emit::joined(required, " | ")) + '>';
  const bool has_fields = !reads.empty();
  const std::string parameters = has_fields ? "(reader, at) => ({\n" : "() => ({\n";
  const std::string value = has_fields ? "(writer, value) => {\n" : "(writer) => {\n";
  return fields_text(model, object) + "export const " + name +
         ": {\n  readonly codec: rtpm.TableCodec<" + name +
         ">;\n  /** A value with these fields; the others have their defaults. */\n  of(fields" +
         (required.empty() ? "?" : "") + ": " + given + "): " + name +
         ";\n} = {\n  codec: rtpm.tableCodec(\n    " + literal(object.name) + ",\n    " +
         std::to_string(verify_limits(model, index).depth) + ",\n    " + parameters + reads +
         "    }),\n    " + value + "      writer.open(" + std::to_string(slot_count) + ");\n" +
         inlines + "      writer.close();\n" + behind + "    },\n  ),\n  of: (" +
         (has_fields ? "fields" : "") + (has_fields && required.empty() ? " = {}" : "") +
         ") => ({\n" + made + "  }),\n};\n";
}

std::string event_text(const Model& model, std::size_t index) {
  const Object& object = model.objects[index];
  const Payload payload = payload_of(model, index);
  std::string fields;
  std::vector<std::string> names;
  for (const EventField& field : event_fields(model, payload)) {
    fields += event_field(field);
    names.push_back(literal(field.name));
  }
  const std::string head = "export const " + event_name(model, object.name) + ": ";
  return "\n/** The event " + object.name +
         (payload.kind == PayloadKind::kStruct ? ", whose payload is the bare struct" : "") +
         ". */\n" + head + event_type(payload_type(model, payload), names, head.size()) +
         " = {\n  name: " + literal(object.name) +
         ",\n  type: " + std::to_string(*object.event_id) +
         ",\n  schemaId: " + hexadecimal(object.event_fingerprint, 16) +
         "n,\n  codec: " + payload_codec(model, payload) + ",\n  fields: [\n" + fields +
         "  ],\n  schema: " + template_literal(schema_text(model, object)) + ",\n};\n";
}

}  // namespace rtpm::schema::typescript
