#include "rtpm/test/alloc_guard.hpp"

#include <execinfo.h>
#include <malloc.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
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
namespace {

std::atomic<std::uint64_t> breach_count{0};
std::atomic<int> count_only_depth{0};
thread_local std::uint64_t allocation_count = 0;

#ifndef RTPM_TEST_HAS_SANITIZER

thread_local bool is_reporting = false;

void print(std::string_view text) noexcept {
  [[maybe_unused]] const auto written = write(STDERR_FILENO, text.data(), text.size());
}

// Everything here runs with the guard off for this thread: the first backtrace() loads a library.
[[noreturn]] void report_and_abort(std::string_view function) noexcept {
  is_reporting = true;
  print("rtpm: bug: ");
  print(function);
  print(" was called by a thread that allocates nothing any more; its stack:\n");
  std::array<void*, 48> frames{};
  const int count = backtrace(frames.data(), static_cast<int>(frames.size()));
  backtrace_symbols_fd(frames.data(), count, STDERR_FILENO);
  std::abort();
}

void check(std::string_view function) noexcept {
  if (is_reporting || !rt::is_allocation_forbidden()) return;
  breach_count.fetch_add(1, std::memory_order_relaxed);
  if (count_only_depth.load(std::memory_order_relaxed) == 0) report_and_abort(function);
}

void check_taking(std::string_view function) noexcept {
  ++allocation_count;
  check(function);
}

#endif

}  // namespace

bool is_alloc_guard_active() noexcept {
#ifdef RTPM_TEST_HAS_SANITIZER
  return false;
#else
  return true;
#endif
}

std::uint64_t allocation_breach_count() noexcept {
  return breach_count.load(std::memory_order_relaxed);
}

std::uint64_t thread_allocation_count() noexcept {
  return allocation_count;
}

CountBreachesOnly::CountBreachesOnly() noexcept {
  count_only_depth.fetch_add(1, std::memory_order_relaxed);
}

CountBreachesOnly::~CountBreachesOnly() {
  count_only_depth.fetch_sub(1, std::memory_order_relaxed);
}

}  // namespace rtpm::test

#ifndef RTPM_TEST_HAS_SANITIZER

// The C library's own functions under the names that it keeps for replacements like these. The C++
// library's operator new and delete call malloc and free, so they need no replacement of their own.
// NOLINTBEGIN(bugprone-reserved-identifier, readability-identifier-naming)
// NOLINTBEGIN(readability-inconsistent-declaration-parameter-name)
extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) {
  rtpm::test::check_taking("malloc");
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
  rtpm::test::check_taking("calloc");
  return __libc_calloc(count, size);
}

void* realloc(void* block, std::size_t size) {
  rtpm::test::check_taking("realloc");
  return __libc_realloc(block, size);
}

void free(void* block) {
  if (block == nullptr) return;
  rtpm::test::check("free");
  __libc_free(block);
}

void* memalign(std::size_t alignment, std::size_t size) {
  rtpm::test::check_taking("memalign");
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  rtpm::test::check_taking("aligned_alloc");
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  rtpm::test::check_taking("posix_memalign");
  void* const taken = __libc_memalign(alignment, size);
  if (taken == nullptr) return ENOMEM;
  *block = taken;
  return 0;
}

}  // extern "C"
// NOLINTEND(readability-inconsistent-declaration-parameter-name)
// NOLINTEND(bugprone-reserved-identifier, readability-identifier-naming)

#endif
