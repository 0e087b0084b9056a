#include <string>
#include <vector>

#include "emit/prose.hpp"
#include "java/java_writer.hpp"

// Structs as records, with a view of their bytes.
namespace rtpm::schema::java {
namespace {

std::string place(const std::string& base, std::size_t offset) {
  return offset == 0 ? base : base + " + " + std::to_string(offset);
}

/// Reads one number at `at`.
std::string read_number(const Type& type, const std::string& at) {
  switch (type.innermost()) {
    case BaseType::kBool:
      return "bytes.get(" + at + ") != 0";
    case BaseType::kInt8:
      return "bytes.get(" + at + ')';
    case BaseType::kUint8:
    case BaseType::kUint16:
    case BaseType::kUint32:
      return "Scalars." + accessor(type) + "(bytes, " + at + ')';
    case BaseType::kInt16:
      return "bytes.getShort(" + at + ')';
    case BaseType::kInt32:
      return "bytes.getInt(" + at + ')';
    case BaseType::kFloat:
      return "bytes.getFloat(" + at + ')';
    case BaseType::kDouble:
      return "bytes.getDouble(" + at + ')';
    default:
      return "bytes.getLong(" + at + ')';
  }
}

/// Writes one number to `at`.
std::string write_number(const Type& type, const std::string& at, const std::string& value) {
  const BaseType base = type.innermost();
  if (base == BaseType::kBool) {
    return "bytes.put(" + at + ", (byte) (" + value + " ? 1 : 0))";
  }
  const std::string checked = "Scalars." + accessor(type) + '(' + value + ')';
  switch (size_of(base)) {
    case 1:
      return "bytes.put(" + at + ", " + checked + ')';
    case 2:
      return "bytes.putShort(" + at + ", " + checked + ')';
    case 4:
      if (base == BaseType::kFloat) return "bytes.putFloat(" + at + ", " + value + ')';
      return "bytes.putInt(" + at + ", " + (base == BaseType::kUint32 ? checked : value) + ')';
    default:
      if (base == BaseType::kDouble) return "bytes.putDouble(" + at + ", " + value + ')';
      return "bytes.putLong(" + at + ", " + value + ')';
  }
}

std::size_t element_size(const Context& context, const Type& type) {
  return type.has_object() ? context.model.objects[*type.index].byte_size
                           : size_of(type.innermost());
}

bool is_enum(const Type& type) noexcept {
  return type.index && !type.has_object();
}

/// One element or field at `at`, as its record has it.
std::string read_one(const Context& context, const Type& type, const std::string& at) {
  if (type.has_object()) return codec(context, type) + ".read(bytes, " + at + ')';
  if (!is_enum(type)) return read_number(type, at);
  return "new " + context.name(context.model.enums[*type.index]) + '(' + read_number(type, at) +
         ')';
}

std::string write_one(const Context& context, const Type& type, const std::string& at,
                      const std::string& value) {
  if (type.has_object()) return codec(context, type) + ".write(bytes, " + at + ", " + value + ')';
  return write_number(type, at, is_enum(type) ? value + ".value()" : value);
}

std::string array_function(const Type& type) {
  const bool is_byte = type.element == BaseType::kInt8 || type.element == BaseType::kUint8;
  return is_byte ? "bytes" : accessor(type) + 's';
}

std::string read_field(const Context& context, const Field& field) {
  const std::string at = place("at", field.offset);
  if (!field.type.is_many()) return read_one(context, field.type, at);
  const std::string count = std::to_string(field.type.fixed_length);
  if (!field.type.index) {
    return "ScalarArrays." + array_function(field.type) + "(bytes, " + at + ", " + count + ')';
  }
  const std::string step = std::to_string(element_size(context, field.type));
  return "ScalarArrays.list(" + count + ", i -> " +
         read_one(context, field.type, at + " + " + step + " * i") + ')';
}

std::string write_field(const Context& context, const Field& field) {
  const std::string at = place("at", field.offset);
  const std::string value = "value." + context.names.member(field.name) + "()";
  if (!field.type.is_many()) return "    " + write_one(context, field.type, at, value) + ";\n";
  const std::string count = std::to_string(field.type.fixed_length);
  if (!field.type.index) {
    return "    ScalarArrays." + array_function(field.type) + "(bytes, " + at + ", " + count +
           ", " + value + ");\n";
  }
  const std::string step = std::to_string(element_size(context, field.type));
  return "    Scalars.count(" + value + ".size(), " + count + ");\n    for (int i = 0; i < " +
         count + "; ++i) {\n      " +
         write_one(context, field.type, at + " + " + step + " * i", value + ".get(i)") +
         ";\n    }\n";
}

/// The type of a number in a view: an enum's is its number, as an object would be garbage.
std::string view_type(const Context& context, const Type& type) {
  Type number;
  number.base = type.innermost();
  return value_type(context, number, false);
}

std::string view_member(const Context& context, const Field& field) {
  const std::string name = context.names.member(field.name);
  std::string index;
  std::string at = place("at", field.offset);
  if (field.type.is_many()) {
    index = "int index";
    at += " + " + std::to_string(element_size(context, field.type)) + " * Scalars.index(index, " +
          std::to_string(field.type.fixed_length) + ')';
  }
  const std::string docs = comment({field_comment(field)}, "    ");
  if (field.type.has_object()) {
    const std::string view = value_type(context,
                                        field.type.is_many() ? Type{.base = BaseType::kObject,
                                                                    .element = BaseType::kNone,
                                                                    .index = field.type.index,
                                                                    .fixed_length = 0}
                                                             : field.type,
                                        false) +
                             ".View";
    return "\n" + docs + "    public " + view + ' ' + name + '(' + index + ") {\n      return " +
           name + "View.wrap(bytes, " + at + ");\n    }\n";
  }
  const std::string type = view_type(context, field.type);
  return "\n" + docs + "    public " + type + ' ' + name + '(' + index + ") {\n      return " +
         read_number(field.type, at) + ";\n    }\n\n    /** Changes it. */\n    public View " +
         name + '(' + (index.empty() ? "" : index + ", ") + type + " value) {\n      " +
         write_number(field.type, at, "value") + ";\n      return this;\n    }\n";
}

std::string view(const Context& context, const Object& object, const std::string& type) {
  std::string views;
  std::string members;
  for (const Field& field : object.fields) {
    if (field.type.has_object()) {
      const std::string inner = context.name(context.model.objects[*field.type.index]);
      views += "    private final " + inner + ".View " + context.names.member(field.name) +
               "View = new " + inner + ".View();\n";
    }
    members += view_member(context, field);
  }
  const std::string size = std::to_string(object.byte_size);
  return "\n  /**\n   * The struct in a buffer, for loops without garbage: one view serves any "
         "number of structs, one\n   * after the other. Threads: one.\n   */\n"
         "  public static final class View {\n    private ByteBuffer bytes;\n    private int "
         "at;\n" +
         views +
         "\n    /** A view of nothing yet: call {@link #wrap} first. */\n    public View() {}\n\n"
         "    /** Shows the struct at a position of a little-endian buffer. */\n"
         "    public View wrap(ByteBuffer bytes, int at) {\n      Scalars.view(bytes, at, " +
         size +
         ");\n      this.bytes = bytes;\n      this.at = at;\n      return this;\n    }\n\n"
         "    /** A copy of the struct. */\n    public " +
         type +
         " toRecord() {\n      return CODEC.read(bytes, at);\n    }\n\n"
         "    /** Overwrites the struct. */\n    public View set(" +
         type + " value) {\n      CODEC.write(bytes, at, value);\n      return this;\n    }\n" +
         members + "  }\n";
}

}  // namespace

GeneratedFile struct_file(const Context& context, const Object& object) {
  const std::string type = context.names.type(object.name);
  std::vector<std::string> reads;
  std::string writes;
  for (const Field& field : object.fields) {
    reads.push_back(read_field(context, field));
    writes += write_field(context, field);
  }
  const std::string body =
      record_head(context, object) + " {\n" + record_constructor(context, object) +
      "  /** The bytes of a struct. */\n  public static final StructCodec<" + type +
      "> CODEC =\n      new StructCodec<>(" + literal(object.name) + ", " +
      std::to_string(object.byte_size) + ", " + std::to_string(object.alignment) + ", " + type +
      "::read, " + type + "::write);\n\n  private static " + type +
      " read(ByteBuffer bytes, int at) {\n" +
      emit::call("    return new " + type, reads, ";\n", "    ") +
      "  }\n\n  private static void write(ByteBuffer bytes, int at, " + type + " value) {\n" +
      writes + "  }\n" + record_comparison(context, object) + view(context, object, type) + "}\n";
  return file(context, context.names.package_of(object.name, object.declaration_file), type, body);
}

}  // namespace rtpm::schema::java
