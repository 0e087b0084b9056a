#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

/// The lines of mpv's JSON IPC: one JSON object per line, in both directions.
/// @source   mpv's manual, "JSON IPC"
namespace rtpm::device_mpv {

/// Longest line: mpv's answers to this driver's commands are shorter.
inline constexpr std::size_t kLineSizeMax = 8192;

/// mpv's answer to one command.
struct Reply {
  std::int64_t request_id = 0;
  bool is_success = false;         ///< False, for instance: no such property exists now.
  std::optional<double> number{};  ///< The data, if it is a number.
  std::optional<bool> flag{};      ///< The data, if it is true or false.
};
/// An event of mpv. The driver polls instead, and ignores events.
struct Event {};
/// A line that is neither.
struct Unreadable {};
using Message = std::variant<Unreadable, Event, Reply>;

/// Reads one line, without its line feed. Foreign text: any bytes are a message of one kind.
/// @realtime set-up only: allocates
[[nodiscard]] Message parse(std::string_view line);

/// A command with arguments that are texts, numbers or flags, as one line with its line feed.
using Word = std::variant<const char*, double, bool>;
/// @realtime set-up only: allocates
[[nodiscard]] std::string command_line(std::int64_t request_id, std::string_view name,
                                       std::initializer_list<Word> arguments);

/// Cuts a stream of bytes into lines. It holds at most kLineSizeMax bytes: it drops a longer line,
/// and only that line, and counts it as overlong.
/// @ownership holds one line
/// @threads  one at a time
/// @realtime alloc-free
class LineCutter {
 public:
  /// Calls `on_line` with each line that `bytes` completes. The line is valid until it returns.
  template <class OnLine>
  void push(std::string_view bytes, OnLine&& on_line) {
    for (const char byte : bytes) {
      if (byte != '\n') {
        append(byte);
        continue;
      }
      if (is_overlong_) {
        ++overlong_count_;
      } else if (size_ > 0) {
        on_line(std::string_view(line_.data(), size_));
      }
      size_ = 0;
      is_overlong_ = false;
    }
  }
  [[nodiscard]] std::uint64_t overlong_count() const noexcept { return overlong_count_; }

 private:
  void append(char byte) noexcept {
    if (size_ == line_.size()) {
      is_overlong_ = true;
    } else {
      line_[size_++] = byte;
    }
  }

  std::array<char, kLineSizeMax> line_{};
  std::size_t size_ = 0;
  bool is_overlong_ = false;
  std::uint64_t overlong_count_ = 0;
};

}  // namespace rtpm::device_mpv
