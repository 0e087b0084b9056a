#include "java/java_names.hpp"

#include <flatbuffers/util.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "emit/name_scope.hpp"
#include "emit/prose.hpp"
#include "model/words.hpp"

namespace rtpm::schema::java {
namespace {

constexpr std::string_view kKeywords[] = {
    "_",       "abstract",  "assert",       "boolean",  "break",      "byte",    "case",
    "catch",   "char",      "class",        "const",    "continue",   "default", "do",
    "double",  "else",      "enum",         "extends",  "false",      "final",   "finally",
    "float",   "for",       "goto",         "if",       "implements", "import",  "instanceof",
    "int",     "interface", "long",         "native",   "new",        "null",    "package",
    "private", "protected", "public",       "return",   "short",      "static",  "strictfp",
    "super",   "switch",    "synchronized", "this",     "throw",      "throws",  "transient",
    "true",    "try",       "void",         "volatile", "while",
};

// Methods of every object, and those of generated classes without parameters.
constexpr std::string_view kMembers[] = {
    "builder",   "clone",    "finalize",  "getClass", "hashCode", "notify",
    "notifyAll", "skeleton", "toBuilder", "toRecord", "toString", "wait",
};

// The types that generated code names without their packages, and names that Java has for no type.
constexpr std::string_view kTypes[] = {
    "Arrays",
    "Builder",
    "ByteBuffer",
    "CallContext",
    "CallOptions",
    "Caller",
    "Codecs",
    "CompletableFuture",
    "CompletionStage",
    "Double",
    "Duration",
    "EventField",
    "EventType",
    "Exception",
    "Float",
    "Flow",
    "Integer",
    "Interface",
    "Kind",
    "List",
    "Long",
    "Method",
    "Boolean",
    "Object",
    "Objects",
    "Operation",
    "Override",
    "PriorityModel",
    "Record",
    "Role",
    "Scalars",
    "Servant",
    "Skeleton",
    "String",
    "StructCodec",
    "TableCodec",
    "TableReader",
    "TableWriter",
    "UnionCodec",
    "Unknown",
    "View",
    "Void",
    "permits",
    "record",
    "sealed",
    "var",
    "yield",
};

bool is_in(std::string_view name, std::span<const std::string_view> names) {
  return std::ranges::find(names, name) != names.end();
}

std::string escaped_package(const std::string& name) {
  std::string result;
  std::size_t begin = 0;
  while (begin <= name.size()) {
    const std::size_t end = std::min(name.find('.', begin), name.size());
    const std::string part = name.substr(begin, end - begin);
    result += (result.empty() ? "" : ".") + part + (is_in(part, kKeywords) ? "_" : "");
    begin = end + 1;
  }
  return result;
}

std::string package_of_file(const std::string& file) {
  std::string name = std::filesystem::path(file).stem().string();
  for (char& c : name)
    c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  if (!name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) != 0) {
    name.insert(0, 1, '_');
  }
  return escaped_package(name);
}

std::string unicode_escape(std::uint32_t unit) {
  return "\\u" + hexadecimal(unit, 4).substr(2);
}

}  // namespace

bool is_shown(const Field& field) noexcept {
  return !field.is_deprecated && field.type.innermost() != BaseType::kUnionType;
}

bool is_shown(const Object& object) noexcept {
  return object.name != "rtpm.Empty";
}

std::string ascii(std::string_view utf_8) {
  std::string result;
  const std::string whole(utf_8);
  const char* const end = whole.c_str() + whole.size();
  for (const char* at = whole.c_str(); at != end;) {
    const auto code = static_cast<std::uint32_t>(flatbuffers::FromUTF8(&at));
    if (code < 0x7f) {
      result += static_cast<char>(code);
    } else if (code < 0x10000) {
      result += unicode_escape(code);
    } else {
      result += unicode_escape(0xd800 + ((code - 0x10000) >> 10)) +
                unicode_escape(0xdc00 + ((code - 0x10000) & 0x3ff));
    }
  }
  return result;
}

std::string literal(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    if (c == '\n') {
      result += "\\n";
    } else {
      result += c;
    }
  }
  return ascii(emit::utf_8(result + '"'));
}

std::string text_block(const std::string& text) {
  // A constant has at most 65535 bytes.
  constexpr std::size_t kPartSize = 32768;
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    std::size_t end = std::min(begin + kPartSize, text.size());
    if (end < text.size()) end = std::min(text.find('\n', end), text.size() - 1) + 1;
    std::string part = "\"\"\"\n";
    std::size_t quote_count = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const char c = text[i];
      const bool ends_line = i + 1 == text.size() || text[i + 1] == '\n';
      quote_count = c == '"' ? quote_count + 1 : 0;
      if (c == '\\' || quote_count == 3) part += '\\';
      if (quote_count == 3) quote_count = 0;
      if (c == '\r') {
        part += "\\r";
      } else if (c == ' ' && ends_line) {
        part += "\\s";
      } else {
        part += c;
      }
    }
    parts.push_back(ascii(emit::utf_8(part + "\"\"\"")));
    begin = end;
  }
  if (parts.empty()) return "\"\"";
  return parts.size() == 1 ? parts.front() : "String.join(\"\", " + emit::joined(parts, ", ") + ')';
}

std::string comment_text(std::string_view text) {
  std::string result;
  const std::string whole(text);
  const char* const end = whole.c_str() + whole.size();
  for (const char* at = whole.c_str(); at != end;) {
    const int code = flatbuffers::FromUTF8(&at);
    const bool is_plain =
        code >= 0x20 && code < 0x7f &&
        std::string_view("&<>@\\*/{}").find(static_cast<char>(code)) == std::string_view::npos;
    const bool is_slash = code == '/' && !result.ends_with("&#42;");
    if (is_plain || is_slash) {
      result += static_cast<char>(code);
    } else {
      result += "&#" + std::to_string(code) + ';';
    }
  }
  return result;
}

std::string comment(const Documentation& lines, const std::string& indent) {
  Documentation escaped;
  for (const std::string& line : lines)
    escaped.push_back(comment_text(emit::utf_8(line)));
  return tagged_comment(escaped, indent);
}

std::string tagged_comment(const Documentation& lines, const std::string& indent) {
  Documentation paragraphs;
  for (std::string line : lines) {
    const std::size_t begin = line.find_first_not_of(" \t\r");
    const bool is_text = begin != std::string::npos && line[begin] != '@' && line[begin] != '<';
    const bool begins_paragraph = !paragraphs.empty() && paragraphs.back().empty();
    if (begin == std::string::npos) line.clear();
    if (is_text && begins_paragraph) line = "<p>" + line.substr(begin);
    if (!line.empty() || !paragraphs.empty()) paragraphs.push_back(std::move(line));
  }
  const auto as_it_is = [](std::string_view text) { return std::string(text); };
  return emit::block_comment(paragraphs, indent, as_it_is);
}

Names::Names(const Model& model) : model_(model) {}

std::string Names::package_of(const std::string& qualified_name,
                              const std::string& declaration_file) const {
  const std::string scope = namespace_of(qualified_name);
  return scope.empty() ? package_of_file(declaration_file) : escaped_package(scope);
}

std::string Names::type(const std::string& qualified_name) const {
  const std::string name = short_name(qualified_name);
  return name +
         (is_in(name, kTypes) || is_in(name, kKeywords) || begins_a_package(name) ? "_" : "");
}

std::string Names::whole(const Object& object) const {
  return package_of(object.name, object.declaration_file) + '.' + type(object.name);
}

std::string Names::whole(const Enum& enumeration) const {
  return package_of(enumeration.name, enumeration.declaration_file) + '.' + type(enumeration.name);
}

std::string Names::member(std::string_view name) const {
  const std::string result = emit::camel(name);
  const bool is_reserved =
      is_in(result, kKeywords) || is_in(result, kMembers) || begins_a_package(result);
  return result + (is_reserved ? "_" : "");
}

std::string Names::constant(std::string_view name) {
  const std::string result = emit::upper_snake(name);
  const bool is_reserved = result == "CODEC" || result == "EVENT" || result == "INTERFACE" ||
                           result == "_" || result.starts_with("RTPM_");
  return result + (is_reserved ? "_" : "");
}

bool Names::begins_a_package(std::string_view name) const {
  const auto begins = [&](const auto& type) {
    const std::string package = package_of(type.name, type.declaration_file);
    return package.substr(0, package.find('.')) == name;
  };
  if (name == "org" || name == "java") return true;
  return std::ranges::any_of(model_.objects, begins) || std::ranges::any_of(model_.enums, begins) ||
         std::ranges::any_of(model_.services, [&](const Service& service) {
           const std::string scope = namespace_of(service.name);
           return scope.substr(0, scope.find('.')) == name;
         });
}

}  // namespace rtpm::schema::java
