#include "rtpm/test/alloc_guard.hpp"

#include <malloc.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string_view>

#include "breaches.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::test {
namespace {

Breaches breaches;
thread_local std::uint64_t allocation_count = 0;

#ifndef RTPM_TEST_HAS_SANITIZER

constexpr std::string_view kCrime = " was called by a thread that allocates nothing any more";

void check(std::string_view function) noexcept {
  if (rt::is_allocation_forbidden()) breaches.add(function, kCrime);
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
  return breaches.count();
}

std::uint64_t thread_allocation_count() noexcept {
  return allocation_count;
}

CountBreachesOnly::CountBreachesOnly() noexcept {
  breaches.begin_counting_only();
}

CountBreachesOnly::~CountBreachesOnly() {
  breaches.end_counting_only();
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
