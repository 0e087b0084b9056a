#include "os/terminal.hpp"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "rtpm/rt/native_time.hpp"

namespace rtpm::program::os {

std::size_t terminal_width() noexcept {
  winsize size{};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

std::optional<InputEnd> read_input(std::shared_ptr<Input>& /*input*/, Duration patience,
                                   std::string& to) {
  const timespec timeout = rt::to_timespec(patience);
  pollfd wanted{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  const int ready_count = ppoll(&wanted, 1, &timeout, nullptr);
  if (ready_count == 0) return InputEnd::kNone;
  std::array<char, 1024> part{};
  const ssize_t size = ready_count < 0 ? -1 : read(STDIN_FILENO, part.data(), part.size());
  if (size > 0) {
    to.append(part.data(), static_cast<std::size_t>(size));
  } else if (size == 0 || errno != EINTR) {
    return InputEnd::kEnd;
  }
  return std::nullopt;
}

}  // namespace rtpm::program::os
