#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace rtpm::schema {

/// A position in a schema, with the text of its line. `line` and `column` count from 1, columns in
/// characters; line 0 means the whole file.
struct Location {
  std::string file{};  ///< As given on the command line.
  std::size_t line = 0;
  std::size_t column = 0;
  std::size_t length = 0;   ///< In characters, for the underline; at most to the end of the line.
  std::string line_text{};  ///< Without the newline; empty if the line has more than 1000 bytes.
};

/// A part of a file's text, in bytes.
struct Span {
  std::size_t offset = 0;
  std::size_t length = 0;
};

/// A schema file's text, with the positions of its lines.
/// @ownership holds its text
class SourceFile {
 public:
  SourceFile(std::string path, std::string text);

  /// Reads the file `path`.
  /// @errors nullopt, and errno is set
  [[nodiscard]] static std::optional<SourceFile> read(const std::string& path);

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  /// The location of `span`; an offset beyond the end counts as the end.
  [[nodiscard]] Location locate(Span span) const;

  /// The offset of byte `column_byte` (from 0) in `line` (from 1); at most the text's size.
  [[nodiscard]] std::size_t offset_of(std::size_t line, std::size_t column_byte) const noexcept;

 private:
  std::string path_;
  std::string text_;
  std::vector<std::size_t> line_starts_;
};

}  // namespace rtpm::schema
