#pragma once

#include <array>
#include <cstdint>

/// Facts about a crash, for its signal handler.
namespace rtpm::rt::os {

/// The calling thread's name, with a zero at its end; empty if the system keeps none.
/// @realtime callable in a signal handler
void name_of_this_thread(std::array<char, 16>& name) noexcept;

/// Where the thread was interrupted, from a signal handler's third argument; 0 if unknown.
/// @realtime callable in a signal handler
[[nodiscard]] std::uintptr_t program_counter(const void* context) noexcept;

}  // namespace rtpm::rt::os
