#include "rtpm/program/terminal.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

namespace rtpm::program {

std::size_t terminal_width(std::size_t otherwise) noexcept {
  winsize size{};
  const bool is_told = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return is_told ? size.ws_col : otherwise;
}

}  // namespace rtpm::program
