#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "emit/prose.hpp"
#include "java/java_writer.hpp"
#include "model/event_fields.hpp"
#include "model/quantities.hpp"
#include "model/verify_limits.hpp"
#include "model/words.hpp"
#include "rtpm/schema/schema_text.hpp"

// Tables as records with a builder, and what records of tables and structs have in common.
namespace rtpm::schema::java {
namespace {

bool is_array(const Context& context, const Field& field) {
  return value_type(context, field.type, false).ends_with("[]");
}

bool is_list(const Context& context, const Field& field) {
  return value_type(context, field.type, false).starts_with("List<");
}

bool is_scalar(const Type& type) noexcept {
  return type.base >= BaseType::kBool && type.base <= BaseType::kDouble;
}

bool is_enum_number(const Type& type) noexcept {
  return is_scalar(type) && type.index;
}

std::vector<const Field*> shown_fields(const Object& object) {
  std::vector<const Field*> fields;
  for (const Field& field : object.fields) {
    if (is_shown(field)) fields.push_back(&field);
  }
  return fields;
}

/// The value of a field that is absent.
std::string absent_value(const Context& context, const Field& field) {
  if (is_scalar(field.type)) return field.is_optional ? "null" : default_value(context, field);
  const std::string type = value_type(context, field.type, false);
  if (is_array(context, field)) return "new " + type.substr(0, type.size() - 1) + "0]";
  if (is_list(context, field)) return "List.of()";
  return field.type.base == BaseType::kString && !field.is_required ? "\"\"" : "null";
}

std::string slot(const Field& field, int difference = 0) {
  return std::to_string(static_cast<int>(field.id) + difference);
}

std::string enum_vector_arguments(const Field& field) {
  const BaseType base = field.type.element;
  const bool is_signed = !is_unsigned(base);
  return std::to_string(size_of(base)) + ", " + (is_signed ? "true" : "false");
}

std::string vector_function(const Context& context, const Type& type) {
  if (type.has_object()) return context.model.objects[*type.index].is_struct ? "structs" : "tables";
  if (type.element == BaseType::kUnion) return "unions";
  if (type.element == BaseType::kString) return "strings";
  const bool is_byte = type.element == BaseType::kInt8 || type.element == BaseType::kUint8;
  return is_byte ? "bytes" : accessor(type) + 's';
}

bool is_enum_vector(const Type& type) noexcept {
  return type.is_many() && type.index && !type.has_object() && type.element != BaseType::kUnion;
}

std::string read_scalar(const Context& context, const Field& field) {
  std::string absent = default_number(field);
  if (field.is_optional) absent = field.type.base == BaseType::kBool ? "false" : "0";
  std::string text = "reader." + accessor(field.type) + "(at, " + slot(field) + ", " + absent + ')';
  if (is_enum_number(field.type))
    text = "new " + value_type(context, field.type, false) + '(' + text + ')';
  return field.is_optional ? "reader.has(at, " + slot(field) + ") ? " + text + " : null" : text;
}

std::string read_slot(const Context& context, const Field& field) {
  const std::string required = field.is_required ? "true" : "false";
  const std::string place = "(at, " + slot(field) + ", ";
  if (is_scalar(field.type)) return read_scalar(context, field);
  if (is_enum_vector(field.type)) {
    Type element = field.type;
    element.base = element.element;
    const std::string type = value_type(context, element, false);
    Type number;
    number.base = element.base;
    const bool is_long = value_type(context, number, false) == "long";
    return "reader.enums" + place + required + ", " + enum_vector_arguments(field) + ", " +
           (is_long ? type + "::new" : "number -> new " + type + "((int) number)") + ')';
  }
  std::string function = "string";
  if (field.type.is_many()) {
    function = vector_function(context, field.type);
  } else if (field.type.base == BaseType::kUnion) {
    function = "union";
  } else if (field.type.has_object()) {
    function = context.model.objects[*field.type.index].is_struct ? "struct" : "table";
  }
  return "reader." + function + place +
         (field.type.index ? codec(context, field.type) + ", " : "") + required + ')';
}

std::string local(const Field& field) {
  return "slot" + slot(field);
}

std::string getter(const Context& context, const Field& field) {
  return "value." + context.names.member(field.name) + "()";
}

std::string write_scalar(const Context& context, const Field& field) {
  const std::string value = getter(context, field) + (field.type.index ? ".value()" : "");
  const std::string head = "writer." + accessor(field.type) + '(' + slot(field) + ", " + value;
  if (!field.is_optional) {
    return "    " + head + ", " + default_number(field) + ");\n";
  }
  return "    if (" + getter(context, field) + " != null) {\n      " + head + ");\n    }\n";
}

/// Adds the field, or the offset to it, to the open table.
std::string write_inline(const Context& context, const Field& field) {
  if (is_scalar(field.type)) return write_scalar(context, field);
  const std::string value = getter(context, field);
  const bool is_union = field.type.innermost() == BaseType::kUnion;
  if (field.type.base == BaseType::kObject && context.model.objects[*field.type.index].is_struct) {
    const std::string name = field.is_required ? ", " + literal(field.name) : "";
    return std::string("    writer.") + (field.is_required ? "requiredStruct(" : "struct(") +
           slot(field) + name + ", " + codec(context, field.type) + ", " + value + ");\n";
  }
  std::string presence = value;
  if (is_list(context, field)) {
    presence = '!' + value + ".isEmpty()";
  } else if (is_array(context, field)) {
    presence = value + ".length != 0";
  } else if (field.type.base == BaseType::kString) {
    presence = '!' + value + ".isEmpty()";
  }
  std::string text;
  if (is_union && field.type.is_many()) {
    text = "    int types" + slot(field) + " = writer.reference(" + slot(field, -1) + ", " +
           (field.is_required ? "true" : presence) + ");\n";
  } else if (is_union) {
    text = "    if (" + value + " != null) {\n      writer.uint8(" + slot(field, -1) + ", " +
           codec(context, field.type) + ".typeOf(" + value + "));\n    }\n";
  }
  const std::string reference =
      field.is_required
          ? "required(" + slot(field) + ", " + literal(field.name) + ", " + value + ')'
          : "reference(" + slot(field) + ", " + presence + ')';
  return text + "    int " + local(field) + " = writer." + reference + ";\n";
}

/// Writes what the field's offset leads to; empty for a field without one.
std::string write_behind(const Context& context, const Field& field) {
  const Type& type = field.type;
  if (is_scalar(type)) return {};
  const std::string value = getter(context, field);
  const std::string lead = local(field) + ", ";
  if (is_enum_vector(type)) {
    return "    writer.enums(" + lead + enum_vector_arguments(field) + ", " + value +
           ", one -> one.value());\n";
  }
  std::string function = "string";
  std::string arguments = lead;
  if (type.is_many()) {
    function = vector_function(context, type);
    if (type.element == BaseType::kUnion) arguments = "types" + slot(field) + ", " + lead;
  } else if (type.base == BaseType::kUnion) {
    function = "union";
  } else if (type.has_object()) {
    if (context.model.objects[*type.index].is_struct) return {};
    function = "table";
  }
  return "    writer." + function + '(' + arguments +
         (type.index ? codec(context, type) + ", " : "") + value + ");\n";
}

std::string builder(const Context& context, const Object& object, const std::string& type) {
  std::string fields;
  std::string copies;
  std::string setters;
  std::vector<std::string> arguments;
  for (const Field* field : shown_fields(object)) {
    const std::string name = context.names.member(field->name);
    const std::string java = value_type(context, field->type, field->is_optional);
    fields += "    private " + java + ' ' + name + " = " + absent_value(context, *field) + ";\n";
    copies += "    builder." + name + " = " + name + ";\n";
    setters += "\n" + comment({field_comment(*field)}, "    ") + "    public Builder " + name +
               '(' + java + ' ' + name + ") {\n      this." + name + " = " + name +
               ";\n      return this;\n    }\n";
    arguments.push_back(name);
  }
  return "\n  /** A builder whose fields have their defaults. */\n"
         "  public static Builder builder() {\n    return new Builder();\n  }\n\n"
         "  /** A builder whose fields are those of this value. */\n"
         "  public Builder toBuilder() {\n    Builder builder = new Builder();\n" +
         copies +
         "    return builder;\n  }\n\n  /** The fields of a new value. Threads: one. */\n"
         "  public static final class Builder {\n" +
         fields + (fields.empty() ? "" : "\n") + "    private Builder() {}\n" + setters +
         "\n    /** The value. */\n    public " + type + " build() {\n" +
         emit::call("      return new " + type, arguments, ";\n", "    ") + "    }\n  }\n";
}

std::string event_default(const Field& field) {
  const bool is_real = field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble;
  return is_real ? real_literal(field.default_real, false)
                 : std::to_string(field.default_integer) + 'L';
}

std::string event_field(const EventField& field) {
  std::vector<std::string> slots;
  for (const std::uint16_t number : field.slots)
    slots.push_back(std::to_string(number));
  const int type = static_cast<int>(field.type) - static_cast<int>(BaseType::kBool);
  return "new EventField(" + literal(field.name) + ", " + std::to_string(type) + ", List.of(" +
         emit::joined(slots, ", ") + "), " + std::to_string(field.offset) + ", " +
         (field.slots.empty() ? "null" : event_default(*field.field)) + ')';
}

}  // namespace

std::string record_head(const Context& context, const Object& object) {
  Documentation lines;
  for (const std::string& line : object.documentation)
    lines.push_back(comment_text(emit::utf_8(line)));
  if (emit::one_line(lines).empty()) {
    lines = {"The " + std::string(object.is_struct ? "struct " : "table ") + object.name + '.'};
  }
  std::vector<std::string> components;
  Documentation notes;
  for (const Field* field : shown_fields(object)) {
    const std::string name = context.names.member(field->name);
    components.push_back(value_type(context, field->type, field->is_optional) + ' ' + name);
    const std::string note = emit::member_note(field->documentation, quantity(*field));
    if (!note.empty()) notes.push_back("@param " + name + ' ' + comment_text(emit::utf_8(note)));
  }
  emit::add_paragraph(lines, notes);
  return tagged_comment(lines, "") +
         emit::call("public record " + context.names.type(object.name), components, "", "    ");
}

std::string record_constructor(const Context& context, const Object& object) {
  std::string text;
  for (const Field* field : shown_fields(object)) {
    const std::string name = context.names.member(field->name);
    if (is_list(context, *field)) {
      text += "    " + name + " = " + name + " == null ? List.of() : List.copyOf(" + name + ");\n";
      continue;
    }
    const bool may_be_null = is_scalar(field->type) && (!field->type.index || field->is_optional);
    const std::string absent = absent_value(context, *field);
    if (object.is_struct || may_be_null || absent == "null") continue;
    text += "    " + name + " = " + name + " == null ? " + absent + " : " + name + ";\n";
  }
  if (text.empty()) return {};
  return "  /** Takes null for what is absent. */\n  public " + context.names.type(object.name) +
         " {\n" + text + "  }\n\n";
}

std::string record_comparison(const Context& context, const Object& object) {
  const std::vector<const Field*> fields = shown_fields(object);
  if (std::ranges::none_of(fields, [&](const Field* field) { return is_array(context, *field); })) {
    return {};
  }
  const std::string type = context.names.type(object.name);
  std::vector<std::string> parts;
  for (const Field* field : fields)
    parts.push_back("value." + context.names.member(field->name) + "()");
  return "\n  private static Object[] partsOf(" + type +
         " value) {\n    return new Object[] {\n      " + emit::joined(parts, ",\n      ") +
         "\n    };\n  }\n\n  @Override\n  public boolean equals(Object other) {\n"
         "    return other instanceof " +
         type + " && Arrays.deepEquals(partsOf(this), partsOf((" + type +
         ") other));\n  }\n\n"
         "  @Override\n  public int hashCode() {\n    return "
         "Arrays.deepHashCode(partsOf(this));\n  }\n\n  @Override\n  public String toString() "
         "{\n    return " +
         literal(short_name(object.name)) + " + Arrays.deepToString(partsOf(this));\n  }\n";
}

std::string event_constant(const Context& context, std::size_t index) {
  const Object& object = context.model.objects[index];
  if (!object.event_id) return {};
  const Payload payload = payload_of(context.model, index);
  std::vector<std::string> fields;
  for (const EventField& field : event_fields(context.model, payload))
    fields.push_back("\n              " + event_field(field));
  return "  /** The event " + std::to_string(*object.event_id) +
         (payload.kind == PayloadKind::kStruct ? ", whose payload is the bare struct" : "") +
         ". */\n  public static final EventType<" + payload_type(context, payload) +
         "> EVENT =\n      new EventType<>(\n          " + literal(object.name) + ",\n          " +
         std::to_string(*object.event_id) + ",\n          " +
         hexadecimal(object.event_fingerprint, 16) + "L,\n          " +
         payload_codec(context, payload) + ",\n          List.of(" + emit::joined(fields, ",") +
         "),\n          " + text_block(schema_text(context.model, object)) + ");\n\n";
}

GeneratedFile table_file(const Context& context, std::size_t index) {
  const Object& object = context.model.objects[index];
  const std::string type = context.names.type(object.name);
  std::vector<std::string> reads;
  std::string inlines;
  std::string behind;
  std::size_t slot_count = 0;
  for (const Field& field : object.fields)
    slot_count = std::max<std::size_t>(slot_count, field.id + 1U);
  for (const Field* field : shown_fields(object)) {
    reads.push_back(read_slot(context, *field));
    inlines += write_inline(context, *field);
    behind += write_behind(context, *field);
  }
  const std::string body =
      record_head(context, object) + " {\n" + record_constructor(context, object) +
      "  /** The FlatBuffer of a table. */\n  public static final TableCodec<" + type +
      "> CODEC =\n      new TableCodec<>(" + literal(object.name) + ", " +
      std::to_string(verify_limits(context.model, index).depth) + ", " + type + "::read, " + type +
      "::write);\n\n" + event_constant(context, index) + "  private static " + type +
      " read(TableReader reader, int at) {\n" +
      emit::call("    return new " + type, reads, ";\n", "    ") +
      "  }\n\n  private static void write(TableWriter writer, " + type +
      " value) {\n    writer.open(" + std::to_string(slot_count) + ");\n" + inlines +
      "    writer.close();\n" + behind + "  }\n" + builder(context, object, type) +
      record_comparison(context, object) + "}\n";
  return file(context, context.names.package_of(object.name, object.declaration_file), type, body);
}

}  // namespace rtpm::schema::java
