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

/// Size of the longest line: mpv's answers to this driver's commands are shorter.
inline constexpr std::size_t kLineSizeMax = 8192;

/// The answer of mpv to one command.
struct Reply {
  std::int64_t request_id = 0;
  bool is_success = false;  ///< False if, for instance, the property does not exist at the moment.
  std::optional<double> number{};  ///< The data if it is a number.
  std::optional<bool> flag{};      ///< The data if it is true or false.
};
/// An event from mpv. The driver polls and ignores events.
struct Event {};
/// A line that is neither a reply nor an event.
struct Unreadable {};
using Message = std::variant<Unreadable, Event, Reply>;

/// Parses one line, without its line feed. Untrusted text: every byte sequence is a message of one
/// kind.
/// @realtime set-up only: allocates
[[nodiscard]] Message parse(std::string_view line);

/// An argument of a command: a text, a number or a flag.
using Word = std::variant<const char*, double, bool>;
/// @realtime set-up only: allocates
[[nodiscard]] std::string command_line(std::int64_t request_id, std::string_view name,
                                       std::initializer_list<Word> arguments);

/// Cuts a byte stream into lines. It stores at most kLineSizeMax bytes: a longer line is dropped
/// and counted as overlong; other lines are not affected.
/// @ownership stores one line
/// @threads  one at a time
/// @realtime alloc-free
class LineCutter {
 public:
  /// Calls `on_line` with each line that `bytes` completes. The line is valid until `on_line`
  /// returns.
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
