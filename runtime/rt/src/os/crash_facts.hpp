#pragma once

#include <array>
#include <cstdint>
#include <string_view>

/// Crashes: how they are noticed, and facts for the line about them.
namespace rtpm::rt::os {

/// Has the process's crashes reported by write_crash() of crash_line.hpp before they end it as usual.
/// Handlers that are there already stay.
/// @realtime set-up only
void catch_crashes() noexcept;

/// Writes to standard error as far as possible.
/// @realtime callable in a signal handler
void write_error(std::string_view text) noexcept;

/// The calling thread's name, with a zero at its end; empty if the system keeps none.
/// @realtime callable in a signal handler
void name_of_this_thread(std::array<char, 16>& name) noexcept;

/// Where the thread was interrupted, from a signal handler's third argument; 0 if unknown.
/// @realtime callable in a signal handler
[[nodiscard]] std::uintptr_t program_counter(const void* context) noexcept;

}  // namespace rtpm::rt::os
