#include "text/json_writer.hpp"

#include <cmath>
#include <utility>

#include "checks/words.hpp"

namespace rtpm::schema {
namespace {

std::string quoted(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text.append(1, '\\').append(1, c);
    } else if (c == '\t') {
      text += "\\t";
    } else if (static_cast<unsigned char>(c) < 0x20) {
      const char* const digits = "0123456789abcdef";
      text.append("\\u00").append(1, digits[(c >> 4) & 0xF]).append(1, digits[c & 0xF]);
    } else {
      text += c;
    }
  }
  return text + '"';
}

}  // namespace

void JsonWriter::begin_value(std::string_view name) {
  if (!is_first_) text_ += ',';
  if (!closers_.empty()) text_.append(1, '\n').append(2 * closers_.size(), ' ');
  if (!name.empty()) text_.append(quoted(name)).append(": ");
  is_first_ = false;
}

JsonWriter& JsonWriter::open(std::string_view name, char bracket) {
  begin_value(name);
  text_ += bracket;
  closers_ += bracket == '{' ? '}' : ']';
  is_first_ = true;
  return *this;
}

JsonWriter& JsonWriter::end() {
  const char closer = closers_.back();
  closers_.pop_back();
  if (!is_first_) text_.append(1, '\n').append(2 * closers_.size(), ' ');
  text_ += closer;
  is_first_ = false;
  return *this;
}

JsonWriter& JsonWriter::text(std::string_view name, std::string_view value) {
  begin_value(name);
  text_ += quoted(value);
  return *this;
}

JsonWriter& JsonWriter::number(std::string_view name, std::int64_t value) {
  begin_value(name);
  text_ += std::to_string(value);
  return *this;
}

JsonWriter& JsonWriter::number(std::string_view name, double value) {
  // JSON has no infinity and no NaN: they are texts, as FlatBuffers writes them.
  if (!std::isfinite(value)) return text(name, number_text(value));
  begin_value(name);
  text_ += number_text(value);
  return *this;
}

JsonWriter& JsonWriter::boolean(std::string_view name, bool value) {
  begin_value(name);
  text_ += value ? "true" : "false";
  return *this;
}

std::string JsonWriter::take() {
  text_ += '\n';
  return std::exchange(text_, {});
}

}  // namespace rtpm::schema
