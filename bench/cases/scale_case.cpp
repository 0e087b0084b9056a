#include <sys/resource.h>

#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"
#include "sides/standalone.hpp"

// The cost, to a caller and to the server, of many other bound clients that are silent.
namespace rtpm::bench {
namespace {

/// Each client has a socket of its own, and over TCP the server has one for each client as well.
void allow_many_sockets() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

expected<void, std::string> bind_silent(Duel& duel, Carrier carrier, int count,
                                        std::vector<Client>& silent) {
  const Running running({&duel.server(Side::kRtpm)});
  for (int i = 0; i < count; ++i) {
    auto client = bind_client(carrier, {.strategy = rt::WaitStrategy::kBlock}, duel.rtpm_url());
    if (!client) return unexpected{client.error()};
    silent.push_back(std::move(*client));
  }
  return {};
}

expected<void, std::string> measure_beside(const Settings& settings, DuelConfig config,
                                           int client_count, Report& report) {
  // One host gets at most three quarters of a lane's sessions, and here all clients share a host.
  config.session_count_max = 2 * static_cast<std::uint32_t>(client_count) + 8;
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 50,
           .turn_size = 500,
           .rest_part = 0.1,
           .part_count = 5},
          report);
  std::vector<Client> silent;
  double grown_kib = 0;
  auto measured = run.measure(start_duel(config, [&](Duel& duel) {
    const pid_t server = duel.server(Side::kRtpm).id();
    const double empty_mib = memory_of(server).resident_mib;
    silent.clear();
    auto bound = bind_silent(duel, config.carrier, client_count - 1, silent);
    grown_kib = 1024 * (memory_of(server).resident_mib - empty_mib);
    return bound ? duel.contenders() : unexpected{bound.error()};
  }));
  if (!measured) return measured;
  Json head = head_of("scale", config);
  head["clients"] = client_count;
  run.report(head, {{"per_client_kib", rounded(grown_kib / client_count)}});
  return {};
}

expected<void, std::string> measure(const Settings& settings, const DuelConfig& config,
                                    Report& report) {
  for (const int client_count : settings.client_counts) {
    if (auto measured = measure_beside(settings, config, client_count, report); !measured) {
      return unexpected{std::to_string(client_count) + " clients: " + measured.error()};
    }
  }
  return {};
}

}  // namespace

void run_scale(const Settings& settings, Report& report) {
  allow_many_sockets();
  measure_each("scale", settings, report, false, measure);
}

}  // namespace rtpm::bench
