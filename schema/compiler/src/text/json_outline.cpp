#include "text/json_outline.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <optional>
#include <system_error>
#include <utility>

namespace rtpm::schema {
namespace {

/// FlatBuffers' own limit.
constexpr int kOutlineDepthMax = 64;
constexpr std::string_view kBlanks = " \t\r\n";

/// Reads values from a text; after a mistake it is at the end.
class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text) {}

  [[nodiscard]] JsonOutline value(int depth) {
    skip_blanks();
    JsonOutline read{.begin = at_, .end = at_};
    if (peek() == '{' || peek() == '[') {
      read.is_object = peek() == '{';
      if (depth == kOutlineDepthMax) {
        at_ = text_.size();
      } else {
        members_into(read, depth);
      }
    } else if (is_quote(peek())) {
      string();
    } else {
      word();
    }
    read.end = at_;
    if (read.members.empty())
      read.word = without_quotes(text_.substr(read.begin, at_ - read.begin));
    return read;
  }

  /// The name, without its quotation marks.
  [[nodiscard]] std::string_view name() {
    skip_blanks();
    const std::size_t begin = at_;
    if (is_quote(peek())) {
      string();
    } else {
      word();
    }
    return without_quotes(text_.substr(begin, at_ - begin));
  }

  [[nodiscard]] bool take(char wanted) {
    skip_blanks();
    if (peek() != wanted) return false;
    ++at_;
    return true;
  }

 private:
  static bool is_quote(char c) { return c == '"' || c == '\''; }
  static std::string_view without_quotes(std::string_view word) {
    return word.size() >= 2 && is_quote(word.front()) ? word.substr(1, word.size() - 2) : word;
  }
  [[nodiscard]] char peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }

  void skip_blanks() {
    for (;;) {
      at_ = std::min(text_.find_first_not_of(kBlanks, at_), text_.size());
      const std::string_view rest = text_.substr(at_);
      if (rest.starts_with("//")) {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (rest.starts_with("/*")) {
        at_ = std::min(text_.find("*/", at_), text_.size() - 2) + 2;
      } else {
        return;
      }
    }
  }

  void string() {
    const char quote = text_[at_++];
    while (at_ < text_.size() && text_[at_] != quote)
      at_ += text_[at_] == '\\' ? 2U : 1U;
    at_ = std::min(at_ + 1, text_.size());
  }

  void word() { at_ = std::min(text_.find_first_of(" \t\r\n,:{}[]\"'", at_), text_.size()); }

  void members_into(JsonOutline& whole, int depth) {
    const char close = whole.is_object ? '}' : ']';
    ++at_;
    while (!take(close)) {
      const std::size_t begin = at_;
      const std::string_view its_name = whole.is_object ? name() : std::string_view();
      if (whole.is_object && !take(':')) return stop();
      JsonOutline member = value(depth + 1);
      member.name = its_name;
      whole.members.push_back(std::move(member));
      static_cast<void>(take(','));
      if (at_ == begin || at_ == text_.size()) return stop();
    }
  }

  void stop() { at_ = text_.size(); }

  std::string_view text_;
  std::size_t at_ = 0;
};

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

/// The object that is a union's value, selected by the neighbouring type member.
std::optional<std::size_t> object_of_union(const Model& model, const Field& field,
                                           const JsonOutline& whole) {
  const auto type = std::ranges::find(whole.members, field.name + "_type", &JsonOutline::name);
  if (type == whole.members.end() || !field.type.index) return std::nullopt;
  const auto& values = model.enums[*field.type.index].values;
  const auto value = std::ranges::find(values, type->word, &EnumValue::name);
  if (value == values.end() || !value->union_type.has_object()) return std::nullopt;
  return value->union_type.index;
}

/// Visits the values of an object that are objects, including the elements of arrays, each with its
/// path and its index in the model.
template <class Visit>
void for_each_object(const Model& model, const Object& object, const JsonOutline& whole,
                     const std::string& path, Visit visit) {
  for (const JsonOutline& member : whole.members) {
    const auto field = std::ranges::find(object.fields, member.name, &Field::name);
    if (field == object.fields.end()) continue;
    const auto index = field->type.has_object() ? field->type.index
                       : field->type.base == BaseType::kUnion
                           ? object_of_union(model, *field, whole)
                           : std::nullopt;
    if (!index) continue;
    const std::string name = (path.empty() ? "" : path + ".") + field->name;
    if (!field->type.is_many()) {
      visit(*index, member, name);
      continue;
    }
    for (std::size_t i = 0; i < member.members.size(); ++i)
      visit(*index, member.members[i], name + "[" + std::to_string(i) + "]");
  }
}

std::string lacking_in(const Model& model, std::size_t index, const JsonOutline& whole,
                       const std::string& path) {
  const Object& object = model.objects[index];
  std::vector<std::string> lacking;
  for (const Field& field : object.fields) {
    if (std::ranges::find(whole.members, field.name, &JsonOutline::name) == whole.members.end())
      lacking.push_back(field.name);
  }
  if (object.is_struct && whole.is_object && !lacking.empty()) {
    return (path.empty() ? short_name(object.name) : "'" + path + "'") + " lacks " +
           listed(lacking) + ": the fields of a struct have no defaults";
  }
  std::string found;
  for_each_object(model, object, whole, path,
                  [&](std::size_t below, const JsonOutline& value, const std::string& name) {
                    if (found.empty()) found = lacking_in(model, below, value, name);
                  });
  return found;
}

template <class Integer>
bool fits(std::string_view text) {
  Integer number{};
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  return read.ec == std::errc{} && read.ptr == text.data() + text.size();
}

bool is_decimal(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789", text.front() == '-' ? 1 : 0) ==
                              std::string_view::npos;
}

/// Whether a number, or a word in its place, fits the type. Syntax that only FlatBuffers knows,
/// such as functions, counts as fitting.
bool fits(BaseType type, std::string_view text) {
  if (!is_decimal(text)) {
    const bool is_letters =
        std::ranges::all_of(text, [](unsigned char c) { return std::isalpha(c) != 0 || c == ' '; });
    constexpr std::array kWords{"true", "false", "nan", "inf", "infinity", "null"};
    return !is_letters || std::ranges::find(kWords, text) != kWords.end();
  }
  switch (type) {
    case BaseType::kInt8:
      return fits<std::int8_t>(text);
    case BaseType::kUint8:
      return fits<std::uint8_t>(text);
    case BaseType::kInt16:
      return fits<std::int16_t>(text);
    case BaseType::kUint16:
      return fits<std::uint16_t>(text);
    case BaseType::kInt32:
      return fits<std::int32_t>(text);
    case BaseType::kUint32:
      return fits<std::uint32_t>(text);
    case BaseType::kInt64:
      return fits<std::int64_t>(text);
    case BaseType::kUint64:
      return fits<std::uint64_t>(text);
    default:
      return true;
  }
}

bool is_number(BaseType type) {
  return type >= BaseType::kInt8 && type <= BaseType::kDouble;
}

std::string misfit_in(const Model& model, std::size_t index, const JsonOutline& whole,
                      const std::string& path) {
  const Object& object = model.objects[index];
  const auto misfits = [&](BaseType type, const JsonOutline& value) {
    return value.members.empty() && !fits(type, value.word);
  };
  for (const JsonOutline& member : whole.members) {
    const auto field = std::ranges::find(object.fields, member.name, &Field::name);
    if (field == object.fields.end()) continue;
    const Type& type = field->type;
    std::string name = (path.empty() ? "" : path + ".") + field->name;
    if (type.base == BaseType::kArray && member.members.size() != type.fixed_length) return name;
    if (type.index || !is_number(type.innermost())) continue;
    if (!type.is_many() && misfits(type.base, member)) return name;
    for (std::size_t i = 0; type.is_many() && i < member.members.size(); ++i) {
      if (misfits(type.element, member.members[i])) return name + "[" + std::to_string(i) + "]";
    }
  }
  std::string found;
  for_each_object(model, object, whole, path,
                  [&](std::size_t below, const JsonOutline& value, const std::string& name) {
                    if (found.empty()) found = misfit_in(model, below, value, name);
                  });
  return found;
}

}  // namespace

JsonOutline outline_of(std::string_view text) {
  return Reader(text).value(0);
}

std::string_view only_name(std::string_view text) {
  Reader reader(text);
  if (!reader.take('{')) return {};
  const std::string_view name = reader.name();
  return reader.take(':') && reader.take('{') ? name : std::string_view();
}

std::string field_before(const JsonOutline& whole, std::string_view text, std::size_t offset) {
  std::string path;
  const JsonOutline* last = &whole;
  for (;;) {
    const auto after = std::ranges::find_if(
        last->members, [&](const JsonOutline& member) { return member.begin >= offset; });
    if (after == last->members.begin()) break;
    const auto member = std::prev(after);
    if (last->is_object) {
      path.append(path.empty() ? "" : ".").append(member->name);
    } else {
      path += "[" + std::to_string(member - last->members.begin()) + "]";
    }
    last = &*member;
  }
  if (last->end >= offset) return path;
  // The parser has already read the next token as well.
  const std::string_view between = text.substr(last->end, offset - last->end);
  const auto is_blank = [](char c) { return kBlanks.find(c) != std::string_view::npos; };
  const auto token_size = std::ranges::count_if(between, [&](char c) { return !is_blank(c); });
  return token_size <= 1 ? path : std::string();
}

std::string lacking_fields(const Model& model, std::size_t object, const JsonOutline& whole) {
  return lacking_in(model, object, whole, {});
}

std::string misfit_field(const Model& model, std::size_t object, const JsonOutline& whole) {
  return misfit_in(model, object, whole, {});
}

std::string with_null_for_no_number(std::string_view json) {
  std::string text;
  text.reserve(json.size());
  bool is_in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (is_in_string && c == '\\') {
      text += json.substr(i, 2);
      ++i;
      continue;
    }
    if (c == '"') is_in_string = !is_in_string;
    const std::size_t sign = c == '-' ? 1 : 0;
    const std::string_view word = json.substr(i + sign, 3);
    if (!is_in_string && (word == "nan" || word == "inf")) {
      text += "null";
      i += sign + 2;
    } else {
      text += c;
    }
  }
  return text;
}

}  // namespace rtpm::schema
