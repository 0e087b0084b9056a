#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Locks all current and future memory of the process, and keeps freed heap mapped, so that no lane
/// page-faults.
/// @realtime set-up only
/// @errors   with kRequire, a memory-lock limit that is too small: even if it covers the current
///           memory, it must leave 256 MiB, since further memory could not be allocated at all.
///           With kPrefer such a program continues unlocked, and warns
[[nodiscard]] expected<void, SetupError> lock_memory(RealtimeMode mode);

/// Makes `memory` resident by touching each page; its contents do not change. Call it before a
/// real-time thread first touches the memory, because memory is locked only once it is resident.
/// Thread::start() does this for threads' stacks.
/// @threads  no other thread writes there meanwhile
/// @realtime set-up only
void prefault(MutableBytes memory) noexcept;

/// Declares that the calling thread allocates nothing while it lives. It does not change the thread
/// itself; the allocation guard that tests link checks this and aborts on a breach.
class NoAllocationScope {
 public:
  NoAllocationScope() noexcept;
  NoAllocationScope(const NoAllocationScope&) = delete;
  NoAllocationScope& operator=(const NoAllocationScope&) = delete;
  ~NoAllocationScope();
};

/// True inside a NoAllocationScope of the calling thread.
/// @realtime alloc-free
[[nodiscard]] bool is_allocation_forbidden() noexcept;

/// Suspends the calling thread's NoAllocationScope for a section that is set-up by nature.
class AllowAllocationScope {
 public:
  AllowAllocationScope() noexcept;
  AllowAllocationScope(const AllowAllocationScope&) = delete;
  AllowAllocationScope& operator=(const AllowAllocationScope&) = delete;
  ~AllowAllocationScope();

 private:
  int depth_;
};

}  // namespace rtpm::rt
