#pragma once

#include <execinfo.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "rtpm/rt/memory.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RTPM_TEST_HAS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define RTPM_TEST_HAS_SANITIZER 1
#endif
#endif

namespace rtpm::test {

/// A guard's reaction to a thread that breaks its promise: it ends the program with the stack, or
/// counts, as long as a test asks for no more.
/// Threads: any.
class Breaches {
 public:
  /// @param crime  the reason why calling `function` is wrong
  void add(std::string_view function, std::string_view crime) noexcept {
    count_.fetch_add(1, std::memory_order_relaxed);
    if (count_only_depth_.load(std::memory_order_relaxed) == 0) report_and_abort(function, crime);
  }
  void begin_counting_only() noexcept { count_only_depth_.fetch_add(1, std::memory_order_relaxed); }
  void end_counting_only() noexcept { count_only_depth_.fetch_sub(1, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t count() const noexcept {
    return count_.load(std::memory_order_relaxed);
  }

 private:
  static void print(std::string_view text) noexcept {
    [[maybe_unused]] const auto written = write(STDERR_FILENO, text.data(), text.size());
  }

  [[noreturn]] static void report_and_abort(std::string_view function,
                                            std::string_view crime) noexcept {
    // The first backtrace() loads a library.
    const rt::AllowAllocationScope is_allowed;
    print("rtpm: bug: ");
    print(function);
    print(crime);
    print("; its stack:\n");
    std::array<void*, 48> frames{};
    const int count = backtrace(frames.data(), static_cast<int>(frames.size()));
    backtrace_symbols_fd(frames.data(), count, STDERR_FILENO);
    std::abort();
  }

  std::atomic<std::uint64_t> count_{0};
  std::atomic<int> count_only_depth_{0};
};

}  // namespace rtpm::test
