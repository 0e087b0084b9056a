#include "rtpm/program/terminal.hpp"

#include "os/terminal.hpp"

namespace rtpm::program {

std::size_t terminal_width(std::size_t otherwise) noexcept {
  const std::size_t width = os::terminal_width();
  return width > 0 ? width : otherwise;
}

}  // namespace rtpm::program
