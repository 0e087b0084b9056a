#include "rtpm/program/line_reader.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

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
  const MonotonicTime until = rt::now() + duration;
  while (!take_line(line)) {
    if (is_at_end_) return Outcome::kEnd;
    const timespec timeout = rt::to_timespec(std::max(Duration{0}, until - rt::now()));
    pollfd wanted{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    const int ready_count = ppoll(&wanted, 1, &timeout, nullptr);
    if (ready_count == 0) return Outcome::kNone;
    std::array<char, 1024> part{};
    const ssize_t size = ready_count < 0 ? -1 : read(STDIN_FILENO, part.data(), part.size());
    if (size > 0) {
      buffer_.append(part.data(), static_cast<std::size_t>(size));
    } else if (size == 0 || errno != EINTR) {
      is_at_end_ = true;
    }
  }
  return Outcome::kLine;
}

}  // namespace rtpm::program
