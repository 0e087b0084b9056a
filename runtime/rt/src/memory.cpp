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
#include "rtpm/rt/report.hpp"

namespace rtpm::rt {
namespace {

thread_local int no_allocation_depth = 0;

constexpr const char* kLockSubject = "memory lock";
constexpr const char* kLockRemedy =
    "raise RLIMIT_MEMLOCK (ulimit -l unlimited, or LimitMEMLOCK=infinity in a systemd unit), or "
    "say --realtime off.";

// Once future memory is locked, the limit applies to all memory. This test memory is released
// untouched.
bool has_room_to_grow() noexcept {
  constexpr std::size_t kRoom = std::size_t{256} << 20;
  void* const room =
      mmap(nullptr, kRoom, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (room == MAP_FAILED) return false;
  munmap(room, kRoom);
  return true;
}

std::string memory_lock_text(const std::string& cause) {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  std::string allowed = limit.rlim_cur == RLIM_INFINITY
                            ? std::string("unlimited")
                            : std::to_string(limit.rlim_cur / 1024) + " KiB";
  return "memory can't be locked (" + cause + "; the limit is " + allowed +
         "): page faults may delay real-time threads";
}

void touch(MutableBytes memory) noexcept {
  constexpr std::size_t kPageSize = 4096;
  auto* const bytes = const_cast<volatile std::byte*>(memory.data());
  for (std::size_t i = 0; i < memory.size(); i += kPageSize)
    bytes[i] = bytes[i];
  if (!memory.empty()) bytes[memory.size() - 1] = bytes[memory.size() - 1];
}

}  // namespace

expected<void, SetupError> lock_memory(RealtimeMode mode) {
  if (mode == RealtimeMode::kOff) {
    note_setup({kLockSubject, Grant::kNotAsked, "memory is not locked", ""});
    return {};
  }
  // Memory that malloc returned to the kernel would page-fault when needed again.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  // Locks on fault: touched memory stays, and memory reserved for large messages costs nothing
  // before the first one. Threads touch their stacks when they start, and containers their
  // elements.
  std::string cause;
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0) {
    cause = std::strerror(errno);
  } else if (has_room_to_grow()) {
    note_setup({kLockSubject, Grant::kGranted, "what is touched stays in memory", ""});
    return {};
  } else {
    // Worse than page faults: from here on the program could allocate no memory and start no
    // thread.
    munlockall();
    cause = "there would be no room to grow";
  }
  const SetupError refusal{memory_lock_text(cause), {}, kLockRemedy};
  if (mode == RealtimeMode::kRequire) return unexpected{refusal};
  note_setup({kLockSubject, Grant::kRefused, refusal.what, kLockRemedy});
  static std::atomic<bool> is_told{false};
  if (!is_told.exchange(true)) {
    std::fprintf(stderr, "rtpm: warning: %s\n", refusal.text().c_str());
  }
  return {};
}

void prefault(MutableBytes memory) noexcept {
  touch(memory);
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
