#include "rtpm/rt/log.hpp"

#include <mutex>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {
namespace {

// Fits one of RTPM's sentences with a few foreign names.
constexpr std::size_t kLineSizeMax = 4096;

// Writes in one piece, so that lines of several threads or processes do not mix.
void write_line(std::FILE* to, std::string_view who, std::string_view text) {
  std::string line = printable(who);
  if (!line.empty()) line += ": ";
  line += printable(text, kLineSizeMax) + "\n";
  std::fputs(line.c_str(), to);
  std::fflush(to);
}

}  // namespace

void print_error(std::string_view who, std::string_view text) {
  write_line(stderr, who, text);
}

Log::Log(std::string who, LogRate rate, std::FILE* to)
    : who_(std::move(who)), to_(to), limit_(rate) {}

Log::~Log() {
  tell_suppressed(limit_.take_all_suppressed());
}

void Log::write(std::string_view text) {
  const std::lock_guard lock(mutex_);
  const MonotonicTime time = now();
  tell_suppressed(limit_.take_suppressed(time));
  if (limit_.admit(time)) write_line(to_, who_, text);
}

void Log::tick() {
  const std::lock_guard lock(mutex_);
  tell_suppressed(limit_.take_suppressed(now()));
}

void Log::tell_suppressed(std::uint64_t count) {
  if (count == 0) return;
  write_line(to_, who_, "… and " + std::to_string(count) + " more suppressed");
}

}  // namespace rtpm::rt
