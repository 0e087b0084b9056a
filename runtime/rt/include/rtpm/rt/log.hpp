#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "rtpm/base/log_limit.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rt {

/// Writes "who: text" as one line to standard error, escaping characters that are unsafe on a
/// terminal (printable()). For a program's last message: it is not rate-limited.
/// @realtime set-up only
void print_error(std::string_view who, std::string_view text);

/// A program's log, one line per event: "who: text", escaped as by print_error(), and rate-limited.
/// Lines above the limit are only counted: "who: … and 17 more suppressed".
/// @threads  any, except real-time threads
/// @realtime set-up only
class Log {
 public:
  explicit Log(std::string who, LogRate rate = {}, std::FILE* to = stderr);
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  /// Reports the number of suppressed lines, if there are any.
  ~Log();

  void write(std::string_view text);
  /// Reports the number of suppressed lines once the rate allows. Call it periodically.
  void tick();

 private:
  void tell_suppressed(std::uint64_t count);

  const std::string who_;
  std::FILE* const to_;
  PiMutex mutex_;
  LogLimit limit_;
};

}  // namespace rtpm::rt
