#pragma once

#include <string_view>

/// The operating system's side of a program that ends badly, for every program of RTPM.
namespace rtpm::program::os {

/// Prints "PROGRAM: first second third" and a line feed to standard error.
/// @realtime alloc-free: there may be no memory
void print_last_error(std::string_view first, std::string_view second = {},
                      std::string_view third = {}) noexcept;

/// Ends the process at once, without destructors.
[[noreturn]] void end_process(int code) noexcept;

/// Whether the exception that ends this program was the system's refusal of memory.
[[nodiscard]] bool is_out_of_memory() noexcept;
/// How a user gives a program more memory.
[[nodiscard]] std::string_view memory_remedy() noexcept;

/// Gives the standard streams the state that programs of RTPM rely on: none is closed, and a write
/// that fails is an error of the write, not the end of the process.
void set_up_streams() noexcept;
/// Writes a line feed to standard output, past its buffer; a failure is in errno.
void write_line_feed() noexcept;

}  // namespace rtpm::program::os
