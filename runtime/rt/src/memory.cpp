#include "rtpm/rt/memory.hpp"

#include <atomic>
#include <cstdio>

#include "os/memory_lock.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/report.hpp"

namespace rtpm::rt {
namespace {

thread_local int no_allocation_depth = 0;

constexpr const char* kLockSubject = "memory lock";

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
  const auto locked = os::lock_all_memory();
  if (locked) {
    const bool is_whole = locked->empty();
    note_setup({kLockSubject, is_whole ? Grant::kGranted : Grant::kPartly,
                is_whole ? "what is touched stays in memory" : *locked, ""});
    return {};
  }
  const SetupError& refusal = locked.error();
  if (mode == RealtimeMode::kRequire) return unexpected{refusal};
  note_setup({kLockSubject, Grant::kRefused, refusal.what, refusal.remedy});
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
