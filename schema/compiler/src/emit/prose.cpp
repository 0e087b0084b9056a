#include "emit/prose.hpp"

#include <flatbuffers/util.h>

#include <algorithm>
#include <iterator>

#include "model/quantities.hpp"

namespace rtpm::schema::emit {

void add_paragraph(Documentation& lines, const Documentation& more) {
  if (!lines.empty() && !more.empty()) lines.emplace_back();
  lines.insert(lines.end(), more.begin(), more.end());
}

std::string one_line(const Documentation& documentation) {
  std::string text;
  for (const std::string& line : documentation) {
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos) continue;
    text += (text.empty() ? "" : " ");
    text.append(line, begin, line.find_last_not_of(" \t\r") + 1 - begin);
  }
  return text;
}

std::string member_note(const Documentation& documentation, const std::string& quantity) {
  const std::string text = one_line(documentation);
  if (quantity.empty() || text.empty()) return text + quantity;
  return text + " (" + quantity + ')';
}

Documentation method_notes(const Model& model, const Method& method) {
  Documentation lines = method.documentation;
  Documentation numbers = quantities(model, method.request, "request");
  std::ranges::copy(quantities(model, method.reply, "reply"), std::back_inserter(numbers));
  add_paragraph(lines, numbers);
  if (const std::string facts = method_facts(method); !facts.empty()) {
    add_paragraph(lines, {facts});
  }
  return lines;
}

Documentation wrapped(std::string line, std::size_t size_max) {
  Documentation lines;
  while (line.size() > size_max) {
    std::size_t blank = line.rfind(' ', size_max);
    if (blank == std::string::npos || blank == 0) blank = line.find(' ', size_max);
    if (blank == std::string::npos) break;
    lines.push_back(line.substr(0, blank));
    line.erase(0, blank + 1);
  }
  lines.push_back(line);
  return lines;
}

std::string utf_8(const std::string& text) {
  std::string result;
  const char* const end = text.c_str() + text.size();
  for (const char* at = text.c_str(); at != end;) {
    const char* const begin = at;
    if (flatbuffers::FromUTF8(&at) >= 0) {
      result.append(begin, at);
    } else {
      result += "\xEF\xBF\xBD";  // U+FFFD, for one byte.
      at = begin + 1;
    }
  }
  return result;
}

std::string joined(const std::vector<std::string>& parts, std::string_view separator) {
  std::string text;
  for (const std::string& part : parts)
    text.append(text.empty() ? "" : separator).append(part);
  return text;
}

std::string call(const std::string& head, const std::vector<std::string>& arguments,
                 const std::string& tail, const std::string& deeper) {
  const std::string line = head + '(' + joined(arguments, ", ") + ')' + tail;
  const std::size_t end = line.find_last_not_of('\n') + 1;
  if (arguments.empty() || end <= kColumnMax) return line;
  const std::string indent = head.substr(0, head.find_first_not_of(' ')) + deeper;
  return head + "(\n" + indent + joined(arguments, ",\n" + indent) + ')' + tail;
}

std::string block_comment(const Documentation& lines, const std::string& indent,
                          std::string (*escape)(std::string_view)) {
  Documentation all;
  for (std::string line : lines) {
    if (line.starts_with(' ')) line.erase(0, 1);
    line.erase(line.find_last_not_of(" \t\r") + 1);
    if (all.empty() && line.empty()) continue;
    std::ranges::copy(wrapped(escape(utf_8(line)), kColumnMax - indent.size() - 3),
                      std::back_inserter(all));
  }
  while (!all.empty() && all.back().empty())
    all.pop_back();
  if (all.empty()) return {};
  if (all.size() == 1 && indent.size() + all.front().size() + 7 <= kColumnMax) {
    return indent + "/** " + all.front() + " */\n";
  }
  std::string text = indent + "/**\n";
  for (const std::string& line : all)
    text += indent + (line.empty() ? " *" : " * ") + line + '\n';
  return text + indent + " */\n";
}

}  // namespace rtpm::schema::emit
