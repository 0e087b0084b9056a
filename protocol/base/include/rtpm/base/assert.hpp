#pragma once

namespace rtpm::inline base {

/// Prints the violated condition and its source line to standard error, then aborts.
[[noreturn]] void assertion_failed(const char* expression, const char* message, const char* file,
                                   int line) noexcept;

}  // namespace rtpm::inline base

/// Aborts if `condition` is false, in release builds too. For bugs in RTPM or its caller, never for
/// conditions that traffic, the operating system or a user can cause.
#define RTPM_ASSERT(condition, message) \
  (static_cast<bool>(condition)         \
       ? static_cast<void>(0)           \
       : ::rtpm::assertion_failed(#condition, message, __FILE__, __LINE__))
