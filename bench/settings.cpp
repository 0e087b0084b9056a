#include "settings.hpp"

#include <sched.h>

#include <algorithm>

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

std::size_t samples_per_round(const Settings& settings, std::uint64_t count_default) {
  const std::uint64_t count = settings.sample_count == 0 ? count_default : settings.sample_count;
  return static_cast<std::size_t>(
      std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count)));
}

std::vector<Rounds> parts_of_run(int round_count, int part_count) {
  const int count = std::min(part_count, round_count);
  std::vector<Rounds> parts;
  parts.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    parts.push_back({.begin = round_count * i / count, .end = round_count * (i + 1) / count});
  return parts;
}

}  // namespace rtpm::bench
