#pragma once

namespace rtpm::inline base {

/// Prints the broken promise with its place to standard error and aborts. Never returns.
/// RT: it ends the process, so its own cost does not matter.
[[noreturn]] void assertion_failed(const char* expression, const char* message, const char* file,
                                   int line) noexcept;

}  // namespace rtpm::inline base

/// Aborts when `condition` is false: for bugs of ours or of the caller, never for what traffic,
/// the operating system or a user can cause. It stays on in release builds.
#define RTPM_ASSERT(condition, message) \
  (static_cast<bool>(condition)         \
       ? static_cast<void>(0)           \
       : ::rtpm::assertion_failed(#condition, message, __FILE__, __LINE__))
