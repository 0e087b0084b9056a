#include "rtpm/schema/source.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <string_view>
#include <utility>

namespace rtpm::schema {
namespace {

/// The number of characters of UTF-8 text: its bytes except continuation bytes.
std::size_t character_count(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char byte) { return (byte & 0xC0) != 0x80; }));
}

/// Longer lines are not shown, because a model has a copy for each of its names.
constexpr std::size_t kShownLineMax = 1000;

}  // namespace

SourceFile::SourceFile(std::string path, std::string text)
    : path_(std::move(path)), text_(std::move(text)), line_starts_{0} {
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') line_starts_.push_back(i + 1);
  }
}

std::optional<SourceFile> SourceFile::read(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  if (!file) return std::nullopt;
  std::string text;
  char buffer[16 * 1024];
  errno = 0;
  while (const std::size_t count = std::fread(buffer, 1, sizeof buffer, file.get())) {
    text.append(buffer, count);
  }
  if (std::ferror(file.get()) != 0) return std::nullopt;
  return SourceFile(path, std::move(text));
}

Location SourceFile::locate(Span span) const {
  const std::size_t begin = std::min(span.offset, text_.size());
  const auto next = std::upper_bound(line_starts_.begin(), line_starts_.end(), begin);
  const std::size_t line_begin = *std::prev(next);
  std::size_t line_end = std::min(text_.find('\n', line_begin), text_.size());
  if (line_end > line_begin && text_[line_end - 1] == '\r') --line_end;
  const std::size_t end = std::min(begin + span.length, std::max(line_end, begin));
  const std::string_view text = text_;
  const auto line = static_cast<std::size_t>(next - line_starts_.begin());
  if (line_end - std::min(line_begin, line_end) > kShownLineMax) {
    return Location{.file = path_, .line = line, .column = begin - line_begin + 1, .length = 1};
  }
  return Location{
      .file = path_,
      .line = line,
      .column = character_count(text.substr(line_begin, begin - line_begin)) + 1,
      .length = character_count(text.substr(begin, end - begin)),
      .line_text = std::string(text.substr(line_begin, line_end - line_begin)),
  };
}

std::size_t SourceFile::offset_of(std::size_t line, std::size_t column_byte) const noexcept {
  const std::size_t index = std::clamp<std::size_t>(line, 1, line_starts_.size()) - 1;
  return std::min(line_starts_[index] + column_byte, text_.size());
}

}  // namespace rtpm::schema
