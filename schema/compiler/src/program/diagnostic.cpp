#include "rtpm/schema/diagnostic.hpp"

#include <algorithm>
#include <cstddef>
#include <tuple>

namespace rtpm::schema {
namespace {

constexpr std::size_t kShownMax = 20;

std::string place(const Location& location) {
  std::string text = location.file;
  if (location.line != 0) {
    text += ':' + std::to_string(location.line) + ':' + std::to_string(location.column);
  }
  return text + ": ";
}

/// The line in the schema and, below it, the mark.
std::string excerpt(const Location& location) {
  if (location.line == 0) return {};
  std::string number = std::to_string(location.line);
  number.insert(0, number.size() < 5 ? 5 - number.size() : 0, ' ');
  std::string text = number + " | " + location.line_text + '\n';
  text += std::string(number.size(), ' ') + " | ";
  // Keeps tabs, so that the mark is aligned at any tab width.
  std::size_t column = 1;
  for (const char byte : location.line_text) {
    if (column >= location.column) break;
    if ((byte & 0xC0) == 0x80) continue;
    text += byte == '\t' ? '\t' : ' ';
    ++column;
  }
  text += '^';
  if (location.length > 1) text += std::string(location.length - 1, '~');
  return text + '\n';
}

}  // namespace

std::string render(const Diagnostic& diagnostic) {
  std::string text = place(diagnostic.location) + "error: " + diagnostic.message + '\n' +
                     excerpt(diagnostic.location);
  if (diagnostic.note) {
    text += place(diagnostic.note->location) + "note: " + diagnostic.note->text + '\n' +
            excerpt(diagnostic.note->location);
  }
  if (!diagnostic.hint.empty()) text += "hint: " + diagnostic.hint + '\n';
  return text;
}

std::string render(Diagnostics diagnostics) {
  std::stable_sort(diagnostics.begin(), diagnostics.end(), [](const auto& a, const auto& b) {
    return std::tie(a.location.file, a.location.line, a.location.column) <
           std::tie(b.location.file, b.location.line, b.location.column);
  });
  std::string text;
  for (std::size_t i = 0; i < std::min(diagnostics.size(), kShownMax); ++i) {
    text += render(diagnostics[i]);
  }
  if (diagnostics.size() > kShownMax) {
    text += "and " + std::to_string(diagnostics.size() - kShownMax) + " more errors\n";
  }
  return text;
}

}  // namespace rtpm::schema
