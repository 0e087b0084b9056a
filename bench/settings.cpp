#include "settings.hpp"

#include <sched.h>

namespace rtpm::bench {

std::string_view to_string(Carrier carrier) noexcept {
  switch (carrier) {
    case Carrier::kUdp:
      return "udp";
    case Carrier::kTcp:
      return "tcp";
    case Carrier::kSharedMemory:
      break;
  }
  return "shm";
}

Placement choose_placement() {
  cpu_set_t usable;
  CPU_ZERO(&usable);
  sched_getaffinity(0, sizeof usable, &usable);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE && cpus.size() < 2; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &usable)) cpus.push_back(cpu);
  }
  if (cpus.empty()) return {};
  return {.client_cpu = cpus.front(), .server_cpu = cpus.back()};
}

std::vector<int> cpus_of(const Placement& placement) {
  if (placement.client_cpu == placement.server_cpu) return {placement.client_cpu};
  return {placement.client_cpu, placement.server_cpu};
}

}  // namespace rtpm::bench
