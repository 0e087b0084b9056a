#include "rtpm/program/line_reader.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "os/terminal.hpp"

namespace rtpm::program {

bool LineReader::take_line(std::string& line) {
  const std::size_t end = buffer_.find('\n');
  if (end != std::string::npos) {
    line = buffer_.substr(0, end);
    buffer_.erase(0, end + 1);
    return true;
  }
  if (buffer_.size() < kLineSizeMax && !(is_at_end_ && !buffer_.empty())) return false;
  line = std::exchange(buffer_, {});
  return true;
}

LineReader::Outcome LineReader::read_for(Duration duration, std::string& line) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  while (!take_line(line)) {
    if (is_at_end_) return Outcome::kEnd;
    const Duration left = std::max(Duration{0}, duration - (Clock::now() - begin));
    const auto end = os::read_input(input_, left, buffer_);
    if (end == os::InputEnd::kNone) return Outcome::kNone;
    is_at_end_ = end == os::InputEnd::kEnd;
  }
  return Outcome::kLine;
}

}  // namespace rtpm::program
