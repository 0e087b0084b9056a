#include "laboratory/toml_nesting.hpp"

#include <vector>

namespace rtpm::laboratory {
namespace {

/// Follows keys and brackets, and skips texts and comments.
class Scanner {
 public:
  Scanner(std::string_view text, std::size_t nesting_max) : text_(text), nesting_max_(nesting_max) {
    open_.reserve(nesting_max + 1);
  }

  std::optional<Position> run() {
    while (at_ < text_.size()) {
      take();
      if (depth_ > nesting_max_) return position_;
    }
    return std::nullopt;
  }

 private:
  void take() {
    const char c = text_[at_];
    if (c == '\n') return end_line();
    if (c == '#') {
      while (at_ < text_.size() && text_[at_] != '\n')
        advance(1);
      return;
    }
    if (c == '"' || c == '\'') return skip_text(c);
    if (c == '.') ++(open_.empty() ? dots_ : open_.back()), ++depth_;
    if (c == '=' || c == ',') begin_value(c);
    if (c == '[' || c == '{') open(c);
    if (c == ']' || c == '}') close();
    if (c != ' ' && c != '\t') is_line_begin_ = false;
    advance(1);
  }

  void advance(std::size_t count) {
    at_ += count;
    position_.column += static_cast<std::uint32_t>(count);
  }

  void end_line() {
    ++at_;
    position_ = {position_.line + 1, 1};
    if (!open_.empty()) return;
    // The parts of a header count for all keys below it.
    if (is_header_) header_ = dots_ + 1;
    is_header_ = false;
    dots_ = 0;
    is_value_ = false;
    depth_ = header_;
    is_line_begin_ = true;
  }

  /// A dot in a number or a time belongs to no key, and its count ends with the value.
  void begin_value(char c) {
    if (c == '=') is_value_ = true;
    if (c == ',' && !open_.empty()) {
      depth_ -= open_.back();
      open_.back() = 0;
    }
  }

  void open(char c) {
    if (c == '[' && is_line_begin_ && open_.empty() && !is_value_) {
      is_header_ = true;
      depth_ = 0;
      dots_ = 0;
      return;
    }
    if (is_header_) return;
    open_.push_back(0);
    ++depth_;
  }

  void close() {
    if (open_.empty()) return;
    depth_ -= open_.back() + 1;
    open_.pop_back();
  }

  /// Skips a text of one line, or of several between three marks. An open text ends the scan.
  void skip_text(char mark) {
    is_line_begin_ = false;
    const bool is_long = text_.substr(at_, 3) == std::string_view(mark == '"' ? "\"\"\"" : "'''");
    const std::size_t mark_count = is_long ? 3 : 1;
    advance(mark_count);
    while (at_ < text_.size()) {
      if (text_[at_] == '\n' && !is_long) return;
      if (text_[at_] == '\n') {
        ++at_;
        position_ = {position_.line + 1, 1};
      } else if (text_[at_] == '\\' && mark == '"' && at_ + 1 < text_.size() &&
                 text_[at_ + 1] != '\n') {
        advance(2);
      } else if (text_[at_] == mark &&
                 (!is_long ||
                  text_.substr(at_, 3) == std::string_view(mark == '"' ? "\"\"\"" : "'''"))) {
        return advance(mark_count);
      } else {
        advance(1);
      }
    }
  }

  std::string_view text_;
  std::size_t nesting_max_;
  std::size_t at_ = 0;
  Position position_{};
  std::vector<std::size_t> open_{};  ///< The dots of the present key of each open bracket.
  std::size_t dots_ = 0;             ///< The dots of the key outside brackets, or of the header.
  std::size_t header_ = 0;           ///< The parts of the present table's name.
  std::size_t depth_ = 0;            ///< The sum of all of these.
  bool is_line_begin_ = true;
  bool is_header_ = false;
  bool is_value_ = false;
};

}  // namespace

std::optional<Position> toml_nested_beyond(std::string_view text, std::size_t nesting_max) {
  return Scanner(text, nesting_max).run();
}

}  // namespace rtpm::laboratory
