#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>

// Part of every program of RTPM, like out_of_memory.cpp: output that can't be written ends the
// program with an exit code that shows it.
namespace {

/// Opens closed streams so that their use fails. Otherwise the next file or socket would take the
/// number of a stream, and the program's output would go there.
void occupy_closed_streams() noexcept {
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream) {
    if (fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // open() returns the lowest free number, which is this one.
    if (open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) != stream) return;
  }
}

/// Fails the program if a part of its output was lost.
void check_output() noexcept {
  const bool has_failed_before = std::ferror(stdout) != 0;
  errno = 0;
  if (std::fflush(stdout) == 0) {
    if (!has_failed_before) return;
    // The reason is no longer known; another write fails with the same one.
    errno = 0;
    static_cast<void>(!write(STDOUT_FILENO, "\n", 1));
  }
  const int error = errno;
  // A reader that has exited, such as head, has read everything it needed.
  if (error != EPIPE) {
    dprintf(STDERR_FILENO,
            "%s: standard output can't be written%s%s. Remedy: free space on its disk, or send it "
            "elsewhere.\n",
            program_invocation_short_name, error == 0 ? "" : ": ",
            error == 0 ? "" : std::strerror(error));
  }
  _exit(1);
}

[[maybe_unused]] const bool are_streams_set = [] {
  occupy_closed_streams();
  // A reader that is gone and a file that is too large are errors of the write.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  return std::atexit(check_output) == 0;
}();

}  // namespace
