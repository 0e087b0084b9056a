#include "typescript/typescript_names.hpp"

#include <algorithm>
#include <functional>
#include <iterator>

#include "emit/name_scope.hpp"
#include "emit/prose.hpp"
#include "model/words.hpp"

namespace rtpm::schema::typescript {
namespace {

// Reserved words, types of the language, and names that generated code uses.
constexpr std::string_view kTypes[] = {
    "Array",
    "AsyncIterable",
    "BigInt64Array",
    "BigUint64Array",
    "DataView",
    "Float32Array",
    "Float64Array",
    "Infinity",
    "Int16Array",
    "Int32Array",
    "Int8Array",
    "NaN",
    "Promise",
    "Uint16Array",
    "Uint32Array",
    "Uint8Array",
    "any",
    "arguments",
    "at",
    "await",
    "bigint",
    "boolean",
    "break",
    "caller",
    "case",
    "catch",
    "class",
    "const",
    "context",
    "continue",
    "debugger",
    "default",
    "delete",
    "do",
    "else",
    "enum",
    "eval",
    "export",
    "extends",
    "false",
    "fields",
    "finally",
    "for",
    "function",
    "i",
    "if",
    "implements",
    "import",
    "in",
    "instanceof",
    "interface",
    "item",
    "let",
    "never",
    "new",
    "null",
    "number",
    "object",
    "one",
    "options",
    "package",
    "private",
    "protected",
    "public",
    "reader",
    "reference",
    "request",
    "return",
    "rtpm",
    "servant",
    "static",
    "string",
    "super",
    "switch",
    "symbol",
    "this",
    "throw",
    "true",
    "try",
    "type",
    "typeof",
    "undefined",
    "unknown",
    "value",
    "var",
    "view",
    "void",
    "while",
    "with",
    "writer",
    "yield",
};
static_assert(std::is_sorted(std::begin(kTypes), std::end(kTypes)));

std::string escaped_type(const std::string& name) {
  const bool is_slot = name.starts_with("slot") || name.starts_with("types");
  const bool is_reserved = std::binary_search(std::begin(kTypes), std::end(kTypes), name);
  return name + (is_reserved || is_slot ? "_" : "");
}

std::string with_underscores(std::string name) {
  std::ranges::replace(name, '.', '_');
  return name;
}

using FilePredicate = std::function<bool(const std::string&)>;

/// The name of a type in a module with the types of the files that `is_known` accepts.
std::string name_among(const Model& model, const std::string& qualified_name,
                       const FilePredicate& is_known) {
  const std::string name = short_name(qualified_name);
  const auto clashes = [&](const auto& type) {
    return is_known(type.declaration_file) && type.name != qualified_name &&
           short_name(type.name) == name;
  };
  const bool is_shared = std::ranges::any_of(model.enums, clashes) ||
                         std::ranges::any_of(model.objects, [&](const Object& object) {
                           return is_shown(object) && clashes(object);
                         });
  return escaped_type(is_shared ? with_underscores(qualified_name) : name);
}

std::string escaped_comment(std::string_view text) {
  std::string result(text);
  for (std::size_t at = 0; (at = result.find("*/", at)) != std::string::npos; ++at)
    result.insert(at + 1, "\\");
  std::erase_if(result, [](char c) { return static_cast<unsigned char>(c) < 0x20; });
  return result;
}

}  // namespace

bool is_shown(const Field& field) noexcept {
  return !field.is_deprecated && field.type.innermost() != BaseType::kUnionType;
}

bool is_shown(const Object& object) noexcept {
  return object.name != "rtpm.Empty";
}

std::string member(std::string_view name) {
  const std::string result = emit::camel(name);
  // Every object has toString and valueOf; one with `then` would be taken for a promise.
  const bool is_reserved = result == "constructor" || result == "then" || result == "toString" ||
                           result == "valueOf" || result == "__proto__";
  return result + (is_reserved ? "_" : "");
}

std::string value_name(std::string_view name) {
  return std::string(name) + (name == "__proto__" ? "_" : "");
}

std::string type_name(const Model& model, const std::string& qualified_name) {
  const auto has_name = [&](const Service& service) { return service.name == qualified_name; };
  if (!std::ranges::any_of(model.services, has_name)) {
    return name_among(model, qualified_name, [](const std::string&) { return true; });
  }
  const std::string name = short_name(qualified_name);
  const bool is_shared = std::ranges::count(model.services, name, [](const Service& service) {
                           return short_name(service.name);
                         }) > 1;
  return is_shared ? with_underscores(qualified_name) : name;
}

std::string name_in_module_of(const Model& model, const std::string& qualified_name,
                              const std::string& file) {
  const auto found = model.included_files.find(file);
  return name_among(model, qualified_name, [&](const std::string& other) {
    return other == file || (found != model.included_files.end() && found->second.contains(other));
  });
}

std::string event_name(const Model& model, const std::string& table) {
  const std::string name = type_name(model, table);
  return name + (name.ends_with("Event") ? "Type" : "Event");
}

std::string check_name(const Model& model, const std::string& qualified_name) {
  return "check" + type_name(model, qualified_name);
}

std::string skeleton_name(const Model& model, const std::string& service) {
  return emit::camel(type_name(model, service)) + "Skeleton";
}

std::string literal(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      result += "\\x" + hexadecimal(static_cast<unsigned char>(c), 2).substr(2);
    } else {
      result += c;
    }
  }
  return emit::utf_8(result + '"');
}

std::string template_literal(std::string_view text) {
  std::string result = "`";
  for (const char c : text) {
    if (c == '`' || c == '\\' || c == '$') result += '\\';
    if (c == '\r') {
      result += "\\r";
    } else {
      result += c;
    }
  }
  return emit::utf_8(result + '`');
}

std::string comment(const Documentation& lines, const std::string& indent) {
  return emit::block_comment(lines, indent, &escaped_comment);
}

}  // namespace rtpm::schema::typescript
