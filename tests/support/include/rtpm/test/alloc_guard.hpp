#pragma once

#include <cstdint>

/// The proof that real-time code allocates nothing. A test binary that links rtpm::alloc_guard has
/// malloc, its relatives and operator new replaced: if the calling thread is inside an
/// rt::NoAllocationScope (like running lanes and device threads), allocating or freeing memory is a
/// breach: it is counted and, unless a test asks otherwise, ends the process with a message and the
/// stack.
///
/// Threads: all of this from any thread.   RT: alloc-free.
namespace rtpm::test {

/// False under AddressSanitizer and ThreadSanitizer, which need malloc for themselves: the guard
/// then sees no breaches. Tests that rely on it skip:
///
///     if (!is_alloc_guard_active()) GTEST_SKIP() << kAllocGuardInactive;
[[nodiscard]] bool is_alloc_guard_active() noexcept;

inline constexpr const char* kAllocGuardInactive =
    "the allocation guard is off in a sanitizer build; run the dev preset";

/// Breaches by any thread since the process began.
[[nodiscard]] std::uint64_t allocation_breach_count() noexcept;

/// Blocks that the calling thread has allocated since it began, inside a scope or not: to count the
/// cost of a stretch of set-up.
[[nodiscard]] std::uint64_t thread_allocation_count() noexcept;

/// While this object exists, breaches are counted but do not abort, for tests of the guard itself.
class CountBreachesOnly {
 public:
  CountBreachesOnly() noexcept;
  CountBreachesOnly(const CountBreachesOnly&) = delete;
  CountBreachesOnly& operator=(const CountBreachesOnly&) = delete;
  ~CountBreachesOnly();
};

}  // namespace rtpm::test
