#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Locks all present and future memory of the process and keeps freed heap mapped, so that no lane
/// meets a page fault.
/// @realtime set-up only
/// @errors   with kRequire, a memory-lock limit that is too small: also if it covers today's memory
///           but not 256 MiB more, since further memory could not be allocated at all. With kPrefer
///           such a program goes on without, and warns
[[nodiscard]] expected<void, SetupError> lock_memory(RealtimeMode mode);

/// Makes `memory` resident by touching each page; its contents stay. Call it before a real-time
/// thread touches the memory first, as memory is locked only once it is resident. Thread::start
/// does this for threads' stacks.
/// @threads  no other thread writes there meanwhile
/// @realtime set-up only
void prefault(MutableBytes memory) noexcept;

/// Declares that the calling thread allocates nothing from here on. The thread itself is unchanged;
/// the allocation guard that tests link checks this and aborts on a breach.
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

/// Lifts the calling thread's scope for a stretch that is set-up by nature.
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
