#pragma once

#include <cstdint>

/// The proof that a real-time thread never waits for a less urgent one that a third thread
/// preempts. In a test binary that links rtpm::lock_guard, a thread inside an rt::NoAllocationScope
/// (like running lanes and device threads) that locks a mutex without priority inheritance, or a
/// read-write lock, which has none at all, is a breach: it is counted and, unless a test asks
/// otherwise, ends the process with a message and the stack. Waiting on a condition takes such a
/// mutex, too.
///
/// Threads: all of this from any thread.   RT: alloc-free.
namespace rtpm::test {

/// False under sanitizers, which replace the same functions. Tests that rely on the guard skip:
///
///     if (!is_lock_guard_active()) GTEST_SKIP() << kLockGuardInactive;
[[nodiscard]] bool is_lock_guard_active() noexcept;

inline constexpr const char* kLockGuardInactive =
    "the lock guard is off in a sanitizer build; run the dev preset";

/// Breaches by any thread since the process began.
[[nodiscard]] std::uint64_t lock_breach_count() noexcept;

/// While this object exists, breaches are counted but do not abort, for tests of the guard itself.
class CountLockBreachesOnly {
 public:
  CountLockBreachesOnly() noexcept;
  CountLockBreachesOnly(const CountLockBreachesOnly&) = delete;
  CountLockBreachesOnly& operator=(const CountLockBreachesOnly&) = delete;
  ~CountLockBreachesOnly();
};

}  // namespace rtpm::test
