#include <array>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "sides/floor.hpp"
#include "sides/standalone.hpp"

// What a server costs that does nothing: its memory, by how many clients are bound, and its CPU.
namespace rtpm::bench {
namespace {

constexpr std::array kClientCounts{0, 1, 100};
constexpr Duration kIdleTime = std::chrono::seconds{3};

/// A client as a program of its own would be one: its own node, hence its own session.
struct Client {
  std::unique_ptr<rpc::Node> node;
  std::unique_ptr<Caller> caller;
};

expected<Client, std::string> bind_client(const DuelConfig& config, const std::string& url) {
  Client client{.node = make_node(config.carrier, config.wait), .caller = nullptr};
  auto caller = connect_rtpm_caller(*client.node, url, kHighPriority);
  if (!caller) return unexpected{caller.error()};
  client.caller = std::move(*caller);
  if (auto called = client.caller->echo(); !called) return unexpected{called.error()};
  return client;
}

Result begin_result(std::string_view name, const DuelConfig& config) {
  Result result{.title = title_of(name, config)};
  result.json.add("case", name);
  result.json.add("transport", to_string(config.carrier));
  result.json.add("wait", rt::to_string(config.wait.strategy));
  return result;
}

Result memory_result(const DuelConfig& config, int client_count, const MemoryUse& use,
                     const MemoryUse& empty, const MemoryUse& floor) {
  Result result = begin_result("memory", config);
  result.json.add("clients", client_count);
  result.json.add("rss_mib", use.resident_mib);
  result.json.add("pss_mib", use.proportional_mib);
  result.json.add("floor_rss_mib", floor.resident_mib);
  std::string note = std::to_string(client_count) +
                     " bound clients: " + short_text(use.resident_mib) + " MiB in memory";
  if (client_count > 0) {
    const double per_client_kib = 1024 * (use.resident_mib - empty.resident_mib) / client_count;
    result.json.add("per_client_kib", per_client_kib);
    note += ", " + short_text(per_client_kib) + " KiB for each";
  }
  result.notes.push_back(note + "; the raw floor's server: " + short_text(floor.resident_mib) +
                         " MiB");
  return result;
}

expected<void, std::string> measure_memory(const Settings& settings, const DuelConfig& config,
                                           Report& report) {
  const auto floor =
      start_standalone(Standalone::kFloor, config.carrier, config.wait.strategy, settings);
  if (!floor) return unexpected{floor.error()};
  const MemoryUse floor_use = memory_of(floor->id());
  floor->pause();
  const auto server =
      start_standalone(Standalone::kRtpm, config.carrier, config.wait.strategy, settings);
  if (!server) return unexpected{server.error()};
  const MemoryUse empty = memory_of(server->id());
  std::vector<Client> clients;
  for (const int count : kClientCounts) {
    while (clients.size() < static_cast<std::size_t>(count)) {
      auto client = bind_client(config, server->address());
      if (!client) return unexpected{client.error()};
      clients.push_back(std::move(*client));
    }
    report.add(memory_result(config, count, memory_of(server->id()), empty, floor_use));
  }
  return {};
}

double idle_percent(const ServerProcess& server) {
  const Duration before = cpu_time_of(server.id());
  const MonotonicTime begin = rt::now();
  rt::sleep_until(begin + kIdleTime);
  const Duration taken = cpu_time_of(server.id()) - before;
  return 100 * std::chrono::duration<double>(taken) /
         std::chrono::duration<double>(rt::now() - begin);
}

/// With one client bound, who called once and no more.
expected<void, std::string> measure_idle(const Settings& settings, const DuelConfig& config,
                                         Report& report) {
  const auto server =
      start_standalone(Standalone::kRtpm, config.carrier, config.wait.strategy, settings);
  if (!server) return unexpected{server.error()};
  const auto client = bind_client(config, server->address());
  if (!client) return unexpected{client.error()};
  const DisturbanceWatch watch({});
  const double percent = idle_percent(*server);
  Result result = begin_result("idle", config);
  result.json.add("clients", 1);
  result.json.add("cpu_percent", percent);
  result.notes.push_back("a server that nobody calls takes " + short_text(percent) + " % of a CPU");
  watch.finish(result, 0);
  report.add(result);
  return {};
}

using Measure = expected<void, std::string> (*)(const Settings&, const DuelConfig&, Report&);

bool run_each(std::string_view name, Measure measure, const Settings& settings, Report& report) {
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      if (auto measured = measure(settings, config, report); !measured) {
        say_not_measured(title_of(name, config), measured.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

}  // namespace

bool run_memory(const Settings& settings, Report& report) {
  return run_each("memory", measure_memory, settings, report);
}

bool run_idle(const Settings& settings, Report& report) {
  return run_each("idle", measure_idle, settings, report);
}

}  // namespace rtpm::bench
