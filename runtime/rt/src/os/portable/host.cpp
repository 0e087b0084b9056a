#include "rtpm/rt/host.hpp"

#include <unistd.h>

#include <algorithm>

#include "rtpm/base/assert.hpp"

namespace rtpm::rt {

// hp-4.1-7: unknown, so clocks' offsets are measured even within one host.
std::uint64_t clock_domain() noexcept {
  return 0;
}

// POSIX does not tell.
std::string program_name() {
  return "a program";
}

std::uint64_t random_u64() noexcept {
  std::uint64_t value = 0;
  while (value == 0) {
    const int result = getentropy(&value, sizeof value);
    RTPM_ASSERT(result == 0, "the kernel gives random bytes");
  }
  return value;
}

std::vector<int> usable_cpus() {
  return {};
}

int usable_cpu_count() noexcept {
  return std::max(1, static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)));
}

}  // namespace rtpm::rt
