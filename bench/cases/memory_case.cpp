#include <array>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "sides/standalone.hpp"

// The cost of an idle server: its memory, by how many clients are bound, and its CPU time.
namespace rtpm::bench {
namespace {

constexpr std::array kClientCounts{0, 1, 100};
constexpr Duration kIdleTime = std::chrono::seconds{3};

Json begin_result(std::string_view name, const DuelConfig& config, int client_count) {
  return {{"case", name},
          {"transport", to_string(config.carrier)},
          {"wait", rt::to_string(config.wait.strategy)},
          {"clients", client_count}};
}

}  // namespace

Outcome<> measure_memory(const Settings& settings, const DuelConfig& config, Report& report) {
  const auto floor = start_standalone(Side::kFloor, config.carrier, config.wait.strategy, settings);
  if (!floor) return failure(floor.error());
  const double floor_mib = resident_mib_of(floor->id());
  floor->pause();
  const auto server = start_standalone(Side::kRtpm, config.carrier, config.wait.strategy, settings);
  if (!server) return failure(server.error());
  const double empty_mib = resident_mib_of(server->id());
  std::vector<Client> clients;
  for (const int count : kClientCounts) {
    while (clients.size() < static_cast<std::size_t>(count)) {
      auto client = bind_client(config.carrier, config.wait, server->address());
      if (!client) return failure(client.error());
      clients.push_back(std::move(*client));
    }
    const double used_mib = resident_mib_of(server->id());
    Json result = begin_result("memory", config, count);
    result["rss_mib"] = rounded(used_mib);
    result["floor_rss_mib"] = rounded(floor_mib);
    if (count > 0) result["per_client_kib"] = rounded(1024 * (used_mib - empty_mib) / count);
    report.add(std::move(result));
  }
  return {};
}

/// Measures with one bound client, which called once.
Outcome<> measure_idle(const Settings& settings, const DuelConfig& config, Report& report) {
  const auto server = start_standalone(Side::kRtpm, config.carrier, config.wait.strategy, settings);
  if (!server) return failure(server.error());
  const auto client = bind_client(config.carrier, config.wait, server->address());
  if (!client) return failure(client.error());
  const CpuTime steal_before = read_cpu_time();
  const Duration before = cpu_time_of(server->id());
  const MonotonicTime begin = rt::now();
  rt::sleep_until(begin + kIdleTime);
  const std::chrono::duration<double> taken = cpu_time_of(server->id()) - before;
  const std::chrono::duration<double> time = rt::now() - begin;
  Json result = begin_result("idle", config, 1);
  result["cpu_percent"] = rounded(100 * taken / time);
  add_steal(result, steal_before);
  report.add(std::move(result));
  return {};
}

}  // namespace rtpm::bench
