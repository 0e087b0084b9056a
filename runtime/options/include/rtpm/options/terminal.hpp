#pragma once

#include <cstddef>

namespace rtpm::options {

/// How many columns the terminal has that standard output is; `otherwise`, if it is none or does
/// not tell.
/// @threads  any
/// @realtime alloc-free, one system call
[[nodiscard]] std::size_t terminal_width(std::size_t otherwise) noexcept;

}  // namespace rtpm::options
