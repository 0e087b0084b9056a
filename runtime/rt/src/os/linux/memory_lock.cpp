#include "os/memory_lock.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <cstring>

namespace rtpm::rt::os {
namespace {

constexpr const char* kRemedy =
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

std::string text_of(const std::string& cause) {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  std::string allowed = limit.rlim_cur == RLIM_INFINITY
                            ? std::string("unlimited")
                            : std::to_string(limit.rlim_cur / 1024) + " KiB";
  return "memory can't be locked (" + cause + "; the limit is " + allowed +
         "): page faults may delay real-time threads";
}

}  // namespace

expected<std::string, SetupError> lock_all_memory() {
  // Memory that malloc returned to the kernel would page-fault when needed again.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  // Locks on fault: touched memory stays, and memory reserved for large messages costs nothing
  // before the first one. Threads touch their stacks when they start, and containers their
  // elements.
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0) {
    return unexpected{SetupError{text_of(std::strerror(errno)), {}, kRemedy}};
  }
  if (has_room_to_grow()) return std::string();
  // Worse than page faults: from here on the program could allocate no memory and start no thread.
  munlockall();
  return unexpected{SetupError{text_of("there would be no room to grow"), {}, kRemedy}};
}

}  // namespace rtpm::rt::os
