#pragma once

#include <cstddef>

namespace rtpm::program {

/// The columns of the terminal at standard output; `otherwise` if it is not a terminal or
/// its width is unknown.
/// @threads  any
/// @realtime alloc-free, one system call
[[nodiscard]] std::size_t terminal_width(std::size_t otherwise) noexcept;

}  // namespace rtpm::program
