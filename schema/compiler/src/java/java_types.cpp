#include <cctype>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/prose.hpp"
#include "java/java_writer.hpp"
#include "model/quantities.hpp"
#include "model/words.hpp"

// How Java writes types and numbers, and the frame of a file.
namespace rtpm::schema::java {
namespace {

// Packages of the types that generated code names without them.
struct Import {
  std::string_view package{};
  std::string_view type{};
};
constexpr Import kImports[] = {
    {"java.nio", "ByteBuffer"},
    {"java.time", "Duration"},
    {"java.util", "Arrays"},
    {"java.util", "List"},
    {"java.util", "Objects"},
    {"java.util.concurrent", "CompletableFuture"},
    {"java.util.concurrent", "CompletionStage"},
    {"java.util.concurrent", "Flow"},
    {"org.rtpm", "CallOptions"},
    {"org.rtpm", "Caller"},
    {"org.rtpm.values", "CallContext"},
    {"org.rtpm.values", "Codecs"},
    {"org.rtpm.values", "EventField"},
    {"org.rtpm.values", "EventType"},
    {"org.rtpm.values", "Interface"},
    {"org.rtpm.values", "Kind"},
    {"org.rtpm.values", "Method"},
    {"org.rtpm.values", "Operation"},
    {"org.rtpm.values", "PriorityModel"},
    {"org.rtpm.values", "Role"},
    {"org.rtpm.values", "ScalarArrays"},
    {"org.rtpm.values", "Scalars"},
    {"org.rtpm.values", "Servant"},
    {"org.rtpm.values", "Skeleton"},
    {"org.rtpm.values", "StructCodec"},
    {"org.rtpm.values", "TableCodec"},
    {"org.rtpm.values", "TableReader"},
    {"org.rtpm.values", "TableWriter"},
    {"org.rtpm.values", "UnionCodec"},
};

bool is_name_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
}

/// Whether `text` has the word, with no package before it.
bool has_word(const std::string& text, std::string_view word) {
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const bool begins = at == 0 || !is_name_character(text[at - 1]);
    const bool ends = end == text.size() || text[end] == '.' || !is_name_character(text[end]);
    if (begins && ends) return true;
  }
  return false;
}

std::string number_type(BaseType base, bool is_optional) {
  switch (base) {
    case BaseType::kBool:
      return is_optional ? "Boolean" : "boolean";
    case BaseType::kUint32:
    case BaseType::kInt64:
    case BaseType::kUint64:
      return is_optional ? "Long" : "long";
    case BaseType::kFloat:
      return is_optional ? "Float" : "float";
    case BaseType::kDouble:
      return is_optional ? "Double" : "double";
    default:
      return is_optional ? "Integer" : "int";
  }
}

std::string array_type(BaseType element) {
  switch (element) {
    case BaseType::kInt8:
    case BaseType::kUint8:
      return "byte[]";
    case BaseType::kInt16:
      return "short[]";
    default:
      return number_type(element, false) + "[]";
  }
}

std::string integer_literal(BaseType base, std::int64_t value) {
  return std::to_string(value) + (number_type(base, false) == "long" ? "L" : "");
}

}  // namespace

std::string value_type(const Context& context, const Type& type, bool is_optional) {
  if (!type.is_many()) {
    if (type.base == BaseType::kString) return "String";
    if (!type.index) return number_type(type.base, is_optional);
    return type.has_object() ? context.name(context.model.objects[*type.index])
                             : context.name(context.model.enums[*type.index]);
  }
  if (type.element == BaseType::kString) return "List<String>";
  if (!type.index) return array_type(type.element);
  Type element = type;
  element.base = type.element;
  return "List<" + value_type(context, element, false) + '>';
}

std::string accessor(const Type& type) {
  switch (type.innermost()) {
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
    case BaseType::kFloat:
      return "float32";
    case BaseType::kDouble:
      return "float64";
    default:
      return "int64";
  }
}

std::string real_literal(double value, bool is_float) {
  const std::string type = is_float ? "Float" : "Double";
  if (std::isnan(value)) return type + ".NaN";
  if (std::isinf(value)) return type + (value < 0 ? ".NEGATIVE" : ".POSITIVE") + "_INFINITY";
  std::string text = number_text(value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text + (is_float ? "f" : "");
}

std::string codec(const Context& context, const Type& type) {
  Type element = type;
  element.base = type.innermost();
  return value_type(context, element, false) + ".CODEC";
}

std::string payload_type(const Context& context, const Payload& payload) {
  if (payload.kind == PayloadKind::kEmpty) return "Void";
  return context.name(context.model.objects[payload.struct_index.value_or(payload.table)]);
}

std::string payload_codec(const Context& context, const Payload& payload) {
  if (payload.kind == PayloadKind::kEmpty) return "Codecs.NOTHING";
  return payload_type(context, payload) + ".CODEC";
}

std::string default_value(const Context& context, const Field& field) {
  const BaseType base = field.type.base;
  if (field.type.index) {
    const Enum& enumeration = context.model.enums[*field.type.index];
    const std::string type = context.name(enumeration);
    for (const EnumValue& value : enumeration.values) {
      if (value.value == field.default_integer) return type + '.' + Names::constant(value.name);
    }
    return "new " + type + '(' + integer_literal(base, field.default_integer) + ')';
  }
  return default_number(field);
}

std::string default_number(const Field& field) {
  const BaseType base = field.type.base;
  if (base == BaseType::kBool) return field.default_integer != 0 ? "true" : "false";
  if (base == BaseType::kFloat || base == BaseType::kDouble) {
    return real_literal(field.default_real, base == BaseType::kFloat);
  }
  return integer_literal(base, field.default_integer);
}

std::string field_comment(const Field& field) {
  const std::string text = emit::one_line(field.documentation);
  return emit::member_note({text.empty() ? "The field " + field.name : text}, quantity(field)) +
         (text.empty() ? "." : "");
}

std::string method_comment(const Context& context, const Method& method) {
  Documentation lines;
  for (const std::string& line : method.documentation)
    lines.push_back(comment_text(emit::utf_8(line)));
  if (emit::one_line(lines).empty()) lines = {"{@code " + method.name + "}."};
  Documentation items;
  for (const auto& [payload, role] :
       {std::pair{method.request, "request"}, std::pair{method.reply, "reply"}}) {
    for (const std::string& line : quantities(context.model, payload, role))
      items.push_back("  <li>" + comment_text(emit::utf_8(line)));
  }
  if (!items.empty()) {
    items.insert(items.begin(), "<ul>");
    items.emplace_back("</ul>");
    emit::add_paragraph(lines, items);
  }
  if (const std::string facts = method_facts(method); !facts.empty()) {
    emit::add_paragraph(lines, {facts});
  }
  return tagged_comment(lines, "  ");
}

GeneratedFile file(const Context& context, const std::string& package,
                   const std::string& class_name, const std::string& body) {
  std::string text = "// Generated by rtpmc " + context.compiler_version + " from " +
                     ascii(emit::utf_8(context.model.file_stem)) +
                     ".fbs. Do not edit it: change the schema.\npackage " + package + ";\n\n";
  bool has_imports = false;
  for (const Import& import : kImports) {
    if (!has_word(body, import.type)) continue;
    text.append("import ").append(import.package).append(".").append(import.type).append(";\n");
    has_imports = true;
  }
  if (has_imports) text += '\n';
  std::string name = package;
  for (char& c : name) {
    if (c == '.') c = '/';
  }
  return {name + '/' + class_name + ".java", text + body};
}

}  // namespace rtpm::schema::java
