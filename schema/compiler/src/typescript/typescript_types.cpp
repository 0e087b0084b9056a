#include <cmath>
#include <cstdint>
#include <string>

#include "emit/prose.hpp"
#include "model/quantities.hpp"
#include "model/words.hpp"
#include "typescript/typescript_names.hpp"
#include "typescript/typescript_writer.hpp"

// How TypeScript writes types and numbers; enumerations and unions.
namespace rtpm::schema::typescript {
namespace {

bool is_big(BaseType base) noexcept {
  return base == BaseType::kInt64 || base == BaseType::kUint64;
}

std::string integer_literal(BaseType base, std::int64_t value) {
  const std::string text = base == BaseType::kUint64
                               ? std::to_string(static_cast<std::uint64_t>(value))
                               : std::to_string(value);
  return text + (is_big(base) ? "n" : "");
}

std::string real_literal(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value < 0 ? "-Infinity" : "Infinity";
  return number_text(value);
}

std::string reading(const Model& model, const EnumValue& value) {
  if (value.union_type.base == BaseType::kString) return "reader.stringAt(at)";
  const std::string name = codec(model, value.union_type);
  return model.objects[*value.union_type.index].is_struct ? "reader.structAt(at, " + name + ')'
                                                          : name + ".read(reader, at)";
}

std::string writing(const Model& model, const EnumValue& value) {
  if (value.union_type.base == BaseType::kString) return "string(reference, value.value)";
  const bool is_struct = model.objects[*value.union_type.index].is_struct;
  return std::string(is_struct ? "structAt" : "table") + "(reference, " +
         codec(model, value.union_type) + ", value.value)";
}

/// A union's member; the name "unknown" is that of members which the schema does not have.
std::string member_name(const EnumValue& value) {
  return literal(value.name + (value.name == "unknown" ? "_" : ""));
}

}  // namespace

std::string value_type(const Model& model, const Type& type) {
  if (!type.is_many()) {
    if (type.index) return type_name(model, referred_name(model, type));
    if (type.base == BaseType::kBool) return "boolean";
    if (type.base == BaseType::kString) return "string";
    return is_big(type.base) ? "bigint" : "number";
  }
  if (const std::string numbers = numbers_type(type.element); !numbers.empty()) return numbers;
  Type element = type;
  element.base = type.element;
  return "readonly " + value_type(model, element) + "[]";
}

std::string codec(const Model& model, const Type& type) {
  return type_name(model, referred_name(model, type)) + ".codec";
}

std::string payload_type(const Model& model, const Payload& payload) {
  if (payload.kind == PayloadKind::kEmpty) return "void";
  return type_name(model, model.objects[payload.struct_index.value_or(payload.table)].name);
}

std::string payload_codec(const Model& model, const Payload& payload) {
  if (payload.kind == PayloadKind::kEmpty) return "rtpm.nothing";
  return payload_type(model, payload) + ".codec";
}

std::string numbers_type(BaseType element) {
  switch (element) {
    case BaseType::kInt8:
      return "Int8Array";
    case BaseType::kUint8:
      return "Uint8Array";
    case BaseType::kInt16:
      return "Int16Array";
    case BaseType::kUint16:
      return "Uint16Array";
    case BaseType::kInt32:
      return "Int32Array";
    case BaseType::kUint32:
      return "Uint32Array";
    case BaseType::kInt64:
      return "BigInt64Array";
    case BaseType::kUint64:
      return "BigUint64Array";
    case BaseType::kFloat:
      return "Float32Array";
    case BaseType::kDouble:
      return "Float64Array";
    default:
      return {};
  }
}

std::string accessor(BaseType base) {
  switch (base) {
    case BaseType::kBool:
      return "bool";
    case BaseType::kInt8:
      return "int8";
    case BaseType::kUint8:
      return "uint8";
    case BaseType::kInt16:
      return "int16";
    case BaseType::kUint16:
      return "uint16";
    case BaseType::kInt32:
      return "int32";
    case BaseType::kUint32:
      return "uint32";
    case BaseType::kInt64:
      return "int64";
    case BaseType::kUint64:
      return "uint64";
    case BaseType::kFloat:
      return "float32";
    default:
      return "float64";
  }
}

std::string default_value(const Model& model, const Field& field) {
  const BaseType base = field.type.base;
  if (base == BaseType::kBool) return field.default_integer != 0 ? "true" : "false";
  if (base == BaseType::kFloat || base == BaseType::kDouble) {
    return real_literal(field.default_real);
  }
  if (field.type.index) {
    const Enum& enumeration = model.enums[*field.type.index];
    for (const EnumValue& value : enumeration.values) {
      if (value.value == field.default_integer) {
        return type_name(model, enumeration.name) + '.' + value_name(value.name);
      }
    }
  }
  return integer_literal(base, field.default_integer);
}

std::string enum_text(const Model& model, const Enum& enumeration) {
  const std::string name = type_name(model, enumeration.name);
  Documentation lines = enumeration.documentation;
  emit::add_paragraph(lines,
                      {enumeration.is_bit_flags
                           ? "Flags, joined by `|`; those that the schema does not have are kept."
                           : "A value that the schema does not have keeps its number."});
  std::string text = '\n' + comment(lines, "") + "export type " + name + " = " +
                     (is_big(enumeration.underlying) ? "bigint" : "number") + ";\nexport const " +
                     name + " = {\n";
  for (const EnumValue& value : enumeration.values) {
    text += comment(value.documentation, "  ") + "  " + value_name(value.name) + ": " +
            integer_literal(enumeration.underlying, value.value) + ",\n";
  }
  return text + "} as const;\n";
}

std::string union_text(const Model& model, const Enum& enumeration) {
  const std::string name = type_name(model, enumeration.name);
  std::string types;
  std::string reads;
  std::string numbers;
  std::string writes;
  for (const EnumValue& value : enumeration.values) {
    if (value.union_type.base == BaseType::kNone) continue;
    const std::string member = member_name(value);
    const std::string number = std::to_string(value.value);
    types += "\n  | { readonly type: " + member +
             "; readonly value: " + value_type(model, value.union_type) + " }";
    reads += "        case " + number + ":\n          return { type: " + member +
             ", value: " + reading(model, value) + " };\n";
    numbers += "        case " + member + ":\n          return " + number + ";\n";
    writes += "        case " + member + ":\n          writer." + writing(model, value) +
              ";\n          break;\n";
  }
  Documentation lines = enumeration.documentation;
  emit::add_paragraph(lines,
                      {"One of several values. `unknown` is a member that the schema does not "
                       "have; it cannot be encoded."});
  return '\n' + comment(lines, "") + "export type " + name + " =" + types +
         "\n  | { readonly type: \"unknown\"; readonly number: number };\nexport const " + name +
         ": { readonly codec: rtpm.UnionCodec<" + name +
         "> } = {\n  codec: {\n    read: (reader, type, at) => {\n      switch (type) {\n" + reads +
         "        default:\n          return { type: \"unknown\", number: type };\n      }\n    "
         "},\n    typeOf: (value) => {\n      switch (value.type) {\n" +
         numbers + "        default:\n          throw new rtpm.BadValue(" +
         literal(enumeration.name + ": the union's member is unknown") +
         ");\n      }\n    },\n    write: (writer, reference, value) => {\n      switch "
         "(value.type) {\n" +
         writes + "        default:\n          break;\n      }\n    },\n  },\n};\n";
}

std::string fields_text(const Model& model, const Object& object) {
  Documentation lines = object.documentation;
  if (emit::one_line(lines).empty()) {
    lines = {std::string(object.is_struct ? "The struct " : "The table ") + object.name + '.'};
  }
  std::string text =
      '\n' + comment(lines, "") + "export interface " + type_name(model, object.name) + " {\n";
  for (const Field& field : object.fields) {
    if (!is_shown(field)) continue;
    const BaseType base = field.type.base;
    const bool may_be_absent = base <= BaseType::kDouble
                                   ? field.is_optional
                                   : (base == BaseType::kObject || base == BaseType::kUnion) &&
                                         !field.is_required && !object.is_struct;
    const std::string note = emit::member_note(field.documentation, quantity(field));
    text += (note.empty() ? "" : comment({note}, "  ")) + "  " + member(field.name) + ": " +
            value_type(model, field.type) + (may_be_absent ? " | undefined" : "") + ";\n";
  }
  return text + "}\n";
}

}  // namespace rtpm::schema::typescript
