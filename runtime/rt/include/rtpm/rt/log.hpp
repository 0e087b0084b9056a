#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "rtpm/base/log_limit.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rt {

/// Writes "who: text" as one line to standard error, with what no terminal should get from other
/// programs escaped (printable()). For the sentence with which a program ends: it is not limited.
/// @realtime set-up only
void print_error(std::string_view who, std::string_view text);

/// The running log of a program, a line for each thing that happens: "who: text", escaped as by
/// print_error(), and so many in a time at most. Of what is above it says only how many lines they
/// were: "who: … and 17 more suppressed".
/// @threads  any, not real-time ones
/// @realtime set-up only
class Log {
 public:
  explicit Log(std::string who, LogRate rate = {}, std::FILE* to = stderr);
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  /// Says how many lines are suppressed, if any are.
  ~Log();

  void write(std::string_view text);
  /// Says how many lines were suppressed, as soon as the rate allows. To be called now and then.
  void tick();

 private:
  void tell_suppressed(std::uint64_t count);

  const std::string who_;
  std::FILE* const to_;
  PiMutex mutex_;
  LogLimit limit_;
};

}  // namespace rtpm::rt
