#include <string>
#include <vector>

#include "emit/prose.hpp"
#include "java/java_writer.hpp"

// Enumerations as records, which keep unknown numbers, and unions as sealed interfaces.
namespace rtpm::schema::java {
namespace {

std::string number(const Enum& enumeration, std::int64_t value) {
  const bool is_long = enumeration.underlying == BaseType::kUint32 ||
                       enumeration.underlying == BaseType::kInt64 ||
                       enumeration.underlying == BaseType::kUint64;
  return std::to_string(value) + (is_long ? "L" : "");
}

std::string flag_methods(const std::string& type) {
  return "\n  /** The flags of both. */\n  public " + type + " or(" + type +
         " other) {\n    return new " + type +
         "(value | other.value);\n  }\n\n  /** Whether this has all flags of the other. */\n"
         "  public boolean has(" +
         type + " other) {\n    return (value & other.value) == other.value;\n  }\n";
}

std::string member_type(const Context& context, const EnumValue& value) {
  return value_type(context, value.union_type, false);
}

bool is_member(const EnumValue& value) noexcept {
  return value.union_type.base != BaseType::kNone;
}

std::string member_record(const Context& context, const std::string& type, const EnumValue& value) {
  Documentation lines = value.documentation;
  if (emit::one_line(lines).empty()) lines = {"The member " + value.name + '.'};
  const std::string name = context.names.type(value.name);
  return comment(lines, "  ") + "  record " + name + '(' + member_type(context, value) +
         " value) implements " + type + " {\n    /** Refuses null. */\n    public " + name +
         " {\n      Objects.requireNonNull(value);\n    }\n  }\n\n";
}

std::string reading(const Context& context, const EnumValue& value) {
  if (value.union_type.base == BaseType::kString) return "reader.stringAt(at)";
  const std::string codec_name = codec(context, value.union_type);
  return context.model.objects[*value.union_type.index].is_struct
             ? "reader.structAt(at, " + codec_name + ')'
             : codec_name + ".read(reader, at)";
}

std::string writing(const Context& context, const EnumValue& value) {
  const std::string name = context.names.type(value.name);
  std::string call = "string(reference, one.value())";
  if (value.union_type.base != BaseType::kString) {
    const bool is_struct = context.model.objects[*value.union_type.index].is_struct;
    call = std::string(is_struct ? "structAt" : "table") + "(reference, " +
           codec(context, value.union_type) + ", one.value())";
  }
  return "if (value instanceof " + name + " one) {\n            writer." + call + ";\n          }";
}

}  // namespace

GeneratedFile enum_file(const Context& context, const Enum& enumeration) {
  const std::string type = context.names.type(enumeration.name);
  Documentation lines = enumeration.documentation;
  emit::add_paragraph(lines, {enumeration.is_bit_flags
                                  ? "Flags; those that the schema does not have are kept."
                                  : "A value that the schema does not have keeps its number."});
  const bool is_long = number(enumeration, 0) == "0L";
  std::string body = comment(lines, "") + "public record " + type + '(' +
                     (is_long ? "long" : "int") + " value) {\n";
  std::string names;
  for (const EnumValue& value : enumeration.values) {
    const std::string text = number(enumeration, value.value);
    Documentation notes = value.documentation;
    if (emit::one_line(notes).empty()) notes = {text + '.'};
    body += comment(notes, "  ") + "  public static final " + type + ' ' +
            Names::constant(value.name) + " = new " + type + '(' + text + ");\n\n";
    names += "    if (value == " + text + ") {\n      return " + literal(value.name) + ";\n    }\n";
  }
  body +=
      "  /** The name in the schema; the number of another value. */\n  @Override\n"
      "  public String toString() {\n" +
      names + "    return " +
      (enumeration.underlying == BaseType::kUint64 ? "Long.toUnsignedString(value)"
                                                   : "String.valueOf(value)") +
      ";\n  }\n";
  if (enumeration.is_bit_flags) body += flag_methods(type);
  return file(context, context.names.package_of(enumeration.name, enumeration.declaration_file),
              type, body + "}\n");
}

GeneratedFile union_file(const Context& context, const Enum& enumeration) {
  const std::string type = context.names.type(enumeration.name);
  std::string body = comment(enumeration.documentation, "");
  if (body.empty()) body = "/** One of several values. */\n";
  body += "public sealed interface " + type + " {\n";
  std::string reads;
  std::string types;
  std::string writes;
  for (const EnumValue& value : enumeration.values) {
    if (!is_member(value)) continue;
    const std::string number = std::to_string(value.value);
    body += member_record(context, type, value);
    reads += "            case " + number + ":\n              return new " +
             context.names.type(value.name) + '(' + reading(context, value) + ");\n";
    types += "          if (value instanceof " + context.names.type(value.name) +
             ") {\n            return " + number + ";\n          }\n";
    writes += (writes.empty() ? "          " : " else ") + writing(context, value);
  }
  body +=
      "  /** A member that the schema does not have; it cannot be encoded. */\n"
      "  record Unknown(int type) implements " +
      type + " {}\n\n  /** How tables read and write it. */\n  UnionCodec<" + type +
      "> CODEC =\n      new UnionCodec<>() {\n        @Override\n        public " + type +
      " read(TableReader reader, int type, int at) {\n          switch (type) {\n" + reads +
      "            default:\n              return new Unknown(type);\n          }\n        }\n\n"
      "        @Override\n        public int typeOf(" +
      type + " value) {\n" + types + "          return UnionCodec.refuse(" +
      literal(enumeration.name) +
      ", value);\n        }\n\n        @Override\n        public void write(TableWriter writer, "
      "int reference, " +
      type + " value) {\n" + writes + "\n        }\n      };\n}\n";
  return file(context, context.names.package_of(enumeration.name, enumeration.declaration_file),
              type, body);
}

}  // namespace rtpm::schema::java
