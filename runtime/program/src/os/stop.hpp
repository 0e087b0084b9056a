#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/time.hpp"

/// The operating system's request to end a program.
namespace rtpm::program::os {

[[nodiscard]] std::vector<int> stop_signals();

/// A file descriptor, or a handle of Windows.
using StopSource = std::intptr_t;
/// Blocks the signals for this and later threads. Without a resource of the system, reports that
/// and exits with code 1.
[[nodiscard]] StopSource open_stop_source();
void close_stop_source(StopSource source) noexcept;
/// Waits for the request; it stays pending, so every thread that asks sees it, now and later.
/// @param patience  not negative; nullopt: for ever. The wait may end early.
/// @return whether the program is to end
[[nodiscard]] bool await_stop(StopSource source, std::optional<Duration> patience) noexcept;

}  // namespace rtpm::program::os
