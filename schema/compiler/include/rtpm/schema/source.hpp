#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace rtpm::schema {

/// A place in a schema, with all that is needed to show it: it outlives the text it came from.
/// `line` and `column` count from 1, columns in characters; line 0 means the file as a whole.
struct Location {
  std::string file{};  ///< As the person named it.
  std::size_t line = 0;
  std::size_t column = 0;
  std::size_t length = 0;   ///< In characters, for the underline; never past the end of the line.
  std::string line_text{};  ///< The whole line, without its end.
};

/// A part of a file's text: `length` bytes from the byte `offset` on.
struct Span {
  std::size_t offset = 0;
  std::size_t length = 0;
};

/// One schema file's text, with the positions of its lines.
/// Ownership: holds its text.   Threads: as any plain value.
class SourceFile {
 public:
  SourceFile(std::string path, std::string text);

  /// Reads the file `path`; nothing if it cannot be read (errno then says why).
  [[nodiscard]] static std::optional<SourceFile> read(const std::string& path);

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  /// Where `span` stands; an offset past the end is taken as the end.
  [[nodiscard]] Location locate(Span span) const;

  /// The offset of the byte `column_byte` (from 0) of `line` (from 1), at most the text's size.
  [[nodiscard]] std::size_t offset_of(std::size_t line, std::size_t column_byte) const noexcept;

 private:
  std::string path_;
  std::string text_;
  std::vector<std::size_t> line_starts_;
};

}  // namespace rtpm::schema
