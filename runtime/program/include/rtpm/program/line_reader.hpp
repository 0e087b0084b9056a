#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/time.hpp"

namespace rtpm::program {
namespace os {
class Input;
}

/// The lines of standard input, for a program that waits for other things, too.
/// @ownership one per program; it reads ahead
/// @threads  one
/// @realtime set-up only
class LineReader {
 public:
  static constexpr std::size_t kLineSizeMax = 4096;  ///< A longer line comes in parts.

  enum class Outcome : std::uint8_t {
    kLine,
    kNone,  ///< No line has come in time.
    kEnd,   ///< There are no more lines.
  };
  /// Waits for a line, at most `duration`, and stores it in `line` without its line end.
  [[nodiscard]] Outcome read_for(Duration duration, std::string& line);

 private:
  [[nodiscard]] bool take_line(std::string& line);

  std::shared_ptr<os::Input> input_{};  ///< On Windows, where a thread reads.
  std::string buffer_{};
  bool is_at_end_ = false;
};

}  // namespace rtpm::program
