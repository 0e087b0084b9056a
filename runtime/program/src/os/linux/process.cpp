#include "os/process.hpp"

#include <cxxabi.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <typeinfo>

namespace rtpm::program::os {
namespace {

bool has_memory() noexcept {
  constexpr std::size_t kLittle = 4096;
  void* const little = std::malloc(kLittle);
  std::free(little);
  return little != nullptr;
}

/// Opens closed streams so that their use fails. Otherwise the next file or socket would take the
/// number of a stream, and the program's output would go there.
void occupy_closed_streams() noexcept {
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream) {
    if (fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // open() returns the lowest free number, which is this one.
    if (open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) != stream) return;
  }
}

}  // namespace

void print_last_error(std::string_view first, std::string_view second,
                      std::string_view third) noexcept {
  dprintf(STDERR_FILENO, "%s: %.*s%.*s%.*s\n", program_invocation_short_name,
          static_cast<int>(first.size()), first.data(), static_cast<int>(second.size()),
          second.data(), static_cast<int>(third.size()), third.data());
}

void end_process(int code) noexcept {
  _exit(code);
}

bool is_out_of_memory() noexcept {
  const std::type_info* const thrown = abi::__cxa_current_exception_type();
  // There may have been no memory for the exception itself.
  return thrown == nullptr
             ? !has_memory()
             : *thrown == typeid(std::bad_alloc) || *thrown == typeid(std::bad_array_new_length);
}

std::string_view memory_remedy() noexcept {
  return "raise the limit of the process (ulimit -v; LimitAS= and MemoryMax= of a systemd unit), "
         "or configure less.";
}

void set_up_streams() noexcept {
  occupy_closed_streams();
  // A reader that is gone and a file that is too large are errors of the write.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

void write_line_feed() noexcept {
  static_cast<void>(!write(STDOUT_FILENO, "\n", 1));
}

}  // namespace rtpm::program::os
