#include "rtpm/rt/memory.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "rtpm/base/assert.hpp"

namespace rtpm::rt {
namespace {

thread_local int no_allocation_depth = 0;

std::string memory_lock_text(int error) {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  std::string allowed = limit.rlim_cur == RLIM_INFINITY
                            ? std::string("unlimited")
                            : std::to_string(limit.rlim_cur / 1024) + " KiB";
  return "memory can't be locked (" + std::string(std::strerror(error)) + "; the limit is " +
         allowed +
         "): page faults may delay real-time threads. Remedy: raise RLIMIT_MEMLOCK "
         "(ulimit -l unlimited, or LimitMEMLOCK=infinity in a systemd unit), or say "
         "--realtime off.";
}

}  // namespace

expected<void, RealtimeError> lock_memory(RealtimeMode mode) {
  if (mode == RealtimeMode::kOff) return {};
  // Memory that malloc returned to the kernel would fault, unlocked, when it is needed again.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  // On fault: what was touched stays, and memory kept for large messages costs nothing before one
  // comes. Threads touch their stacks when they start, and containers their elements.
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return {};
  const int error = errno;
  if (mode == RealtimeMode::kRequire) {
    return unexpected{RealtimeError{memory_lock_text(error)}};
  }
  static std::atomic<bool> is_told{false};
  if (!is_told.exchange(true)) {
    std::fprintf(stderr, "rtpm: warning: %s\n", memory_lock_text(error).c_str());
  }
  return {};
}

NoAllocationScope::NoAllocationScope() noexcept {
  ++no_allocation_depth;
}

NoAllocationScope::~NoAllocationScope() {
  RTPM_ASSERT(no_allocation_depth > 0, "scopes end on the thread they began on");
  --no_allocation_depth;
}

bool is_allocation_forbidden() noexcept {
  return no_allocation_depth > 0;
}

AllowAllocationScope::AllowAllocationScope() noexcept : depth_(no_allocation_depth) {
  no_allocation_depth = 0;
}

AllowAllocationScope::~AllowAllocationScope() {
  no_allocation_depth = depth_;
}

}  // namespace rtpm::rt
