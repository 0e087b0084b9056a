#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "os/process.hpp"

// Part of every program of RTPM, like out_of_memory.cpp: output that can't be written ends the
// program with an exit code that shows it.
namespace {

namespace os = rtpm::program::os;

/// Fails the program if a part of its output was lost.
void check_output() noexcept {
  const bool has_failed_before = std::ferror(stdout) != 0;
  errno = 0;
  if (std::fflush(stdout) == 0) {
    if (!has_failed_before) return;
    // The reason is no longer known; another write fails with the same one.
    errno = 0;
    os::write_line_feed();
  }
  const int error = errno;
  // A reader that has exited, such as head, has read everything it needed.
  if (error != EPIPE) {
    constexpr const char* kRemedy = ". Remedy: free space on its disk, or send it elsewhere.";
    if (error == 0) {
      os::print_last_error("standard output can't be written", kRemedy);
    } else {
      os::print_last_error("standard output can't be written: ", std::strerror(error), kRemedy);
    }
  }
  os::end_process(1);
}

[[maybe_unused]] const bool are_streams_set = [] {
  os::set_up_streams();
  return std::atexit(check_output) == 0;
}();

}  // namespace
