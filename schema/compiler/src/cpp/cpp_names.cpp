#include "cpp/cpp_names.hpp"

#include <algorithm>
#include <array>
#include <iterator>

#include "cpp/cpp_macros.hpp"

namespace rtpm::schema::cpp {
namespace {

// The keywords of C++20.
constexpr std::string_view kKeywords[] = {
    "alignas",       "alignof",     "and",
    "and_eq",        "asm",         "auto",
    "bitand",        "bitor",       "bool",
    "break",         "case",        "catch",
    "char",          "char16_t",    "char32_t",
    "char8_t",       "class",       "co_await",
    "co_return",     "co_yield",    "compl",
    "concept",       "const",       "const_cast",
    "consteval",     "constexpr",   "constinit",
    "continue",      "decltype",    "default",
    "delete",        "do",          "double",
    "dynamic_cast",  "else",        "enum",
    "explicit",      "export",      "extern",
    "false",         "float",       "for",
    "friend",        "goto",        "if",
    "inline",        "int",         "long",
    "mutable",       "namespace",   "new",
    "noexcept",      "not",         "not_eq",
    "nullptr",       "operator",    "or",
    "or_eq",         "private",     "protected",
    "public",        "register",    "reinterpret_cast",
    "requires",      "return",      "short",
    "signed",        "sizeof",      "static",
    "static_assert", "static_cast", "struct",
    "switch",        "template",    "this",
    "thread_local",  "throw",       "true",
    "try",           "typedef",     "typeid",
    "typename",      "union",       "unsigned",
    "using",         "virtual",     "void",
    "volatile",      "wchar_t",     "while",
    "xor",           "xor_eq",
};
static_assert(std::is_sorted(std::begin(kKeywords), std::end(kKeywords)));

// flatc appends an underscore to the keywords and to these words.
constexpr std::array<std::string_view, 6> kOnlyFlatcEscapes{
    "atomic_cancel", "atomic_commit", "atomic_noexcept", "import", "module", "synchronized"};
constexpr std::array<std::string_view, 3> kFlatcLeaves{"char8_t", "consteval", "constinit"};

template <class Names>
bool contains(const Names& names, std::string_view name) {
  return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

bool is_escaped_by_flatc(std::string_view name) noexcept {
  return (is_keyword(name) && !contains(kFlatcLeaves, name)) || contains(kOnlyFlatcEscapes, name);
}

}  // namespace

bool is_keyword(std::string_view name) noexcept {
  return std::binary_search(std::begin(kKeywords), std::end(kKeywords), name);
}

std::string method_name(const Service& service, const Method& method) {
  constexpr std::array<std::string_view, 5> kOwn{"binding", "dispatch", "interface",
                                                 "rtpm_functions_", "rtpm_binding_"};
  const std::string class_stem = short_name(service.name);
  const bool is_taken = is_keyword(method.name) || is_macro(method.name) ||
                        contains(kOwn, method.name) || method.name == class_stem + "Client" ||
                        method.name == class_stem + "Servant" ||
                        method.name == class_stem + "MethodId";
  return is_taken ? method.name + '_' : method.name;
}

EventNames event_names(const std::string& table) {
  constexpr std::string_view kEvent = "Event";
  if (!short_name(table).ends_with(kEvent)) {
    return {table + "Event", table + "Supplier", table + "Consumer"};
  }
  const bool is_bare = short_name(table) == kEvent;
  const std::string stem = table.substr(0, table.size() - (is_bare ? 0 : kEvent.size()));
  return {table + "Traits", stem + "Supplier", stem + "Consumer"};
}

std::string namespace_name(const std::string& namespace_with_dots) {
  std::string name;
  for (const char c : namespace_with_dots) {
    if (c == '.') {
      name += "::";
    } else {
      name += c;
    }
  }
  return name;
}

std::string type_name(const std::string& qualified_name) {
  std::string name = "::";
  name += namespace_name(qualified_name);
  if (is_escaped_by_flatc(short_name(qualified_name))) name += '_';
  return name;
}

std::string data_name(const std::string& name) {
  return is_escaped_by_flatc(name) ? name + '_' : name;
}

std::string function(const Function& function, std::string_view indent) {
  constexpr std::size_t kColumnMax = 100;
  const std::string margin(indent);
  const std::string deeper = margin + "    ";
  std::string parameters;
  for (const std::string& parameter : function.parameters) {
    parameters.append(parameters.empty() ? "" : ", ").append(parameter);
  }
  std::string text = margin + function.lead + function.result;
  const std::string rest = function.name + '(' + parameters + ')' + function.tail + '\n';
  if (text.size() + rest.size() <= kColumnMax) return text + ' ' + rest;
  if (text.size() + 1 + function.name.size() + 1 > kColumnMax) {
    text += '\n' + margin;
    if (margin.size() + rest.size() <= kColumnMax + 1) return text + rest;
  } else {
    text += ' ';
  }
  text += function.name + '(';
  if (deeper.size() + parameters.size() + 1 + function.tail.size() <= kColumnMax) {
    return text + '\n' + deeper + parameters + ')' + function.tail + '\n';
  }
  std::string_view separator;
  for (const std::string& parameter : function.parameters) {
    text.append(separator).append(1, '\n').append(deeper).append(parameter);
    separator = ",";
  }
  return text + ')' + function.tail + '\n';
}

std::string literal(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

std::string comment(const Documentation& lines, std::string_view indent) {
  std::string text;
  for (std::string line : lines) {
    // A trailing backslash would continue the comment on the next line.
    while (!line.empty() && (line.back() == '\\' || line.back() == ' ' || line.back() == '\t' ||
                             line.back() == '\r')) {
      line.pop_back();
    }
    const bool needs_space = !line.empty() && line.front() != ' ';
    text += std::string(indent) + "///" + (needs_space ? " " : "") + line + '\n';
  }
  return text;
}

std::string raw_literal(const std::string& text) {
  std::string mark = "rtpm";
  while (text.find(')' + mark + '"') != std::string::npos)
    mark += '_';
  return "R\"" + mark + '(' + text + ')' + mark + '"';
}

}  // namespace rtpm::schema::cpp
