#include "interface_reader.hpp"

#include <algorithm>

namespace rtpm::wire {
namespace {

/// Removes and returns `text` up to `mark`, and drops the mark; returns all of it if there is no
/// mark.
std::string_view take_until(std::string_view& text, std::string_view mark) noexcept {
  const std::size_t at = text.find(mark);
  const std::string_view taken = text.substr(0, at);
  text.remove_prefix(at == std::string_view::npos ? text.size() : at + mark.size());
  return taken;
}

bool take(std::string_view& text, std::string_view begin) noexcept {
  if (!text.starts_with(begin)) return false;
  text.remove_prefix(begin.size());
  return true;
}

std::string_view take_word(std::string_view& text) noexcept {
  return take_until(text, " ");
}

/// For example "lab.Force" from "struct lab.Force".
std::string_view behind_word(std::string_view text) noexcept {
  (void)take_word(text);
  return text;
}

/// Removes ` NAME "VALUE"` from the end of `text`.
std::string_view take_quoted_end(std::string_view& text, std::string_view name) noexcept {
  const std::size_t at = text.find(name);
  if (at == std::string_view::npos || text.size() <= at + name.size() || !text.ends_with('"')) {
    return {};
  }
  std::string_view value = text.substr(at + name.size());
  value.remove_suffix(1);
  text = text.substr(0, at);
  return value;
}

bool is_rule(std::string_view word) noexcept {
  return word == "required" || word == "optional" || word == "deprecated" || word == "key" ||
         word == "=" || word.find(':') != std::string_view::npos;
}

std::optional<MethodText> read_method(std::string_view line, std::string_view& rest) noexcept {
  MethodText method;
  method.id = take_word(line);
  method.name = take_word(line);
  method.is_idempotent = line == "idempotent" || take(line, "idempotent ");
  if (line != "idempotent") method.manner = line;
  std::string_view request = take_until(rest, "\n");
  std::string_view reply = take_until(rest, "\n");
  if (method.name.empty() || !take(request, "request ") || !take(reply, "reply ")) {
    return std::nullopt;
  }
  method.request = request;
  method.reply = reply;
  return method;
}

std::optional<TypeText> read_type(std::string_view line, std::string_view& rest) {
  constexpr std::string_view kBegin = " {";
  if (!line.ends_with(kBegin)) return std::nullopt;
  TypeText type;
  type.head = line.substr(0, line.size() - kBegin.size());
  std::string_view words = type.head;
  type.kind = take_word(words);
  type.name = take_word(words);
  while (!rest.empty()) {
    std::string_view member = take_until(rest, "\n");
    if (member == "}") return type;
    if (!take(member, "  ")) return std::nullopt;
    type.members.push_back(member);
  }
  return std::nullopt;
}

}  // namespace

std::string_view MethodText::request_table() const noexcept {
  return behind_word(request);
}
std::string_view MethodText::reply_table() const noexcept {
  return behind_word(reply);
}

// hp-6.3-2
std::optional<InterfaceText> read_interface(std::string_view text) {
  InterfaceText interface;
  std::string_view first = take_until(text, "\n");
  if (!take(first, "service ")) return std::nullopt;
  interface.name = first;
  while (!text.empty()) {
    std::string_view line = take_until(text, "\n");
    if (take(line, "method ")) {
      const auto method = read_method(line, text);
      if (!method) return std::nullopt;
      interface.methods.push_back(*method);
    } else {
      auto type = read_type(line, text);
      if (!type) return std::nullopt;
      const std::string_view name = type->name;
      if (!interface.types.emplace(name, std::move(*type)).second) return std::nullopt;
    }
  }
  return interface;
}

std::string_view id_of(std::string_view field) noexcept {
  return take_word(field);
}

std::optional<FieldText> read_field(std::string_view line) noexcept {
  FieldText field;
  field.id = take_word(line);
  field.name = take_until(line, ": ");
  if (field.name.empty() || line.empty()) return std::nullopt;
  // Parsed from the end, because units and frames may contain spaces.
  field.frame = take_quoted_end(line, " frame \"");
  field.unit = take_quoted_end(line, " in \"");
  field.type = take_word(line);
  const std::string_view name = line.substr(0, line.find(' '));
  if (!is_rule(name)) field.type_name = take_word(line);
  while (!line.empty()) {
    const std::string_view rules = line;
    const std::string_view word = take_word(line);
    if (word == "required") {
      field.is_required = true;
    } else if (word == "optional") {
      field.is_optional = true;
    } else if (word == "deprecated") {
      field.is_deprecated = true;
    } else if (word == "key") {
      field.is_key = true;
    } else if (word == "=") {
      field.default_value = take_word(line);
    } else {
      // hp-12.2-1: an unknown attribute must be the same on both sides.
      field.encodings = rules;
      break;
    }
  }
  return field;
}

std::optional<ValueText> read_value(std::string_view line) noexcept {
  ValueText value;
  value.name = take_until(line, " = ");
  value.number = take_until(line, ": ");
  if (value.name.empty() || value.number.empty()) return std::nullopt;
  value.type = line;
  value.type_name = behind_word(line);
  return value;
}

}  // namespace rtpm::wire
