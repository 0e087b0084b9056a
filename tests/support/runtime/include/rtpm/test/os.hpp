#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/native_thread.hpp"

/// The operating system's own view of a thread, for tests that do not rely on RTPM's;
/// native_thread.hpp has the part that each system has for itself.
namespace rtpm::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kHasSanitizer = true;
#elif defined(__has_feature)
inline constexpr bool kHasSanitizer =
    __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
inline constexpr bool kHasSanitizer = false;
#endif
inline constexpr const char* kSanitizersLockNothing = "sanitizers make locking memory a no-op";

/// Waits until `is_so()`; false if it stays false for so long that something is wrong.
template <class Condition>
[[nodiscard]] bool await(Condition is_so, Duration patience = std::chrono::seconds{20}) {
  const MonotonicTime end = rt::now() + patience;
  while (!is_so()) {
    if (rt::now() >= end) return false;
    rt::sleep_until(rt::now() + std::chrono::microseconds{500});
  }
  return true;
}

}  // namespace rtpm::test
