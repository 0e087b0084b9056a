#include "source_tree.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>

namespace rtpm::tidy {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 16> kFolders{
    "bench",     "clients",  "cmake",    "debian",  "devices", "docs", "examples", "gvd",
    "packaging", "protocol", "registry", "runtime", "schema",  "spec", "tests",    ".ci"};

constexpr std::array<std::string_view, 14> kTextSuffixes{".cpp", ".hpp",   ".h",    ".fbs", ".txt",
                                                         ".md",  ".cmake", ".json", ".sh",  ".py",
                                                         ".lua", ".ts",    ".tsx",  ".mjs"};

bool is_text(const fs::path& path) {
  const std::string suffix = path.extension().string();
  return suffix.empty() ||
         std::find(kTextSuffixes.begin(), kTextSuffixes.end(), suffix) != kTextSuffixes.end();
}

SourceFile read(const fs::path& root, const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {fs::relative(path, root).generic_string(),
          std::string(std::istreambuf_iterator<char>(stream), {})};
}

/// Walks C++ text and blanks all but code; newlines stay, so that line numbers do.
class Blanker {
 public:
  explicit Blanker(std::string_view text) : text_(text), code_(text) {}

  std::string run() {
    while (at_ < text_.size()) {
      if (starts_with("//")) {
        blank_until(text_.find('\n', at_));
      } else if (starts_with("/*")) {
        blank_past("*/", at_ + 2);
      } else if (starts_with("R\"")) {
        skip_raw_string();
      } else if (text_[at_] == '"') {
        skip_literal('"');
      } else if (text_[at_] == '\'' && !is_digit_separator()) {
        skip_literal('\'');
      } else {
        ++at_;
      }
    }
    return std::move(code_);
  }

 private:
  [[nodiscard]] bool starts_with(std::string_view prefix) const {
    return text_.substr(at_, prefix.size()) == prefix;
  }
  [[nodiscard]] bool is_digit_separator() const {
    return at_ > 0 && std::isalnum(static_cast<unsigned char>(text_[at_ - 1])) != 0;
  }
  void blank_until(std::size_t end) {
    for (end = std::min(end, text_.size()); at_ < end; ++at_) {
      if (text_[at_] != '\n') code_[at_] = ' ';
    }
  }
  void blank_past(std::string_view terminator, std::size_t from) {
    const std::size_t end = text_.find(terminator, from);
    blank_until(end == std::string_view::npos ? text_.size() : end + terminator.size());
  }
  void skip_raw_string() {
    const std::size_t open = text_.find('(', at_);
    if (open == std::string_view::npos) {
      at_ = text_.size();
      return;
    }
    const std::string delimiter(text_.substr(at_ + 2, open - at_ - 2));
    blank_past(")" + delimiter + "\"", open);
  }
  void skip_literal(char quote) {
    for (++at_; at_ < text_.size() && text_[at_] != quote && text_[at_] != '\n'; ++at_) {
      if (text_[at_] == '\\' && at_ + 1 < text_.size()) code_[at_++] = ' ';
      if (text_[at_] != '\n') code_[at_] = ' ';
    }
    if (at_ < text_.size()) ++at_;
  }

  std::string_view text_;
  std::string code_;
  std::size_t at_ = 0;
};

}  // namespace

std::vector<SourceFile> read_tree(const fs::path& root) {
  std::vector<SourceFile> files;
  for (const auto& entry : fs::directory_iterator(root)) {
    if (entry.is_regular_file() && is_text(entry.path())) files.push_back(read(root, entry.path()));
  }
  for (const std::string_view folder : kFolders) {
    if (!fs::exists(root / folder)) continue;
    for (fs::recursive_directory_iterator entry(root / folder); entry != fs::end(entry); ++entry) {
      // The packages that npm installs beside the console's page for work on it.
      if (entry->path().filename() == "node_modules") entry.disable_recursion_pending();
      if (entry->is_regular_file() && is_text(entry->path())) {
        files.push_back(read(root, entry->path()));
      }
    }
  }
  std::sort(files.begin(), files.end(),
            [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    lines.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) break;
    text.remove_prefix(end + 1);
  }
  return lines;
}

std::string code_of(std::string_view text) {
  return Blanker(text).run();
}

bool is_cpp(const SourceFile& file) {
  return file.path.ends_with(".cpp") || file.path.ends_with(".hpp") || file.path.ends_with(".h");
}

Fault fault_at(const SourceFile& file, std::size_t line_index, std::string_view text) {
  return file.path + ":" + std::to_string(line_index + 1) + ": " + std::string(text);
}

}  // namespace rtpm::tidy
