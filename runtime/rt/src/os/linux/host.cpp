#include "rtpm/rt/host.hpp"

#include <fcntl.h>
#include <sched.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "rtpm/base/assert.hpp"

namespace rtpm::rt {

std::uint64_t clock_domain() noexcept {
  std::array<char, 64> boot_id{};
  const int file = open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  const ssize_t boot_id_size = read(file, boot_id.data(), boot_id.size());
  close(file);
  if (boot_id_size <= 0) return 0;
  // A container may have its own time namespace, with a shifted monotonic clock.
  std::array<char, 64> time_namespace{};
  const ssize_t time_namespace_size =
      readlink("/proc/self/ns/time", time_namespace.data(), time_namespace.size());
  return clock_domain_of(
      {boot_id.data(), static_cast<std::size_t>(boot_id_size)},
      {time_namespace.data(), static_cast<std::size_t>(std::max<ssize_t>(time_namespace_size, 0))});
}

std::string program_name() {
  return program_invocation_short_name;
}

std::uint64_t random_u64() noexcept {
  std::uint64_t value = 0;
  while (value == 0) {
    const ssize_t size = getrandom(&value, sizeof value, 0);
    RTPM_ASSERT(size == sizeof value || errno == EINTR, "the kernel gives random bytes");
    if (size != sizeof value) value = 0;
  }
  return value;
}

std::vector<int> usable_cpus() {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  std::vector<int> numbers;
  if (sched_getaffinity(0, sizeof cpus, &cpus) != 0) return numbers;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &cpus)) numbers.push_back(cpu);
  }
  return numbers;
}

int usable_cpu_count() noexcept {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  if (sched_getaffinity(0, sizeof cpus, &cpus) != 0) return 1;
  return CPU_COUNT(&cpus);
}

}  // namespace rtpm::rt
