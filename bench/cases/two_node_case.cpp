
#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"
#include "sides/network_pair.hpp"

namespace rtpm::bench {
namespace {

expected<void, std::string> measure(const Settings& settings, const DuelConfig& sides,
                                    Report& report) {
  const auto network = NetworkPair::create();
  if (!network) return unexpected{network.error()};
  DuelConfig config = sides;
  config.host = NetworkPair::kServerAddress;
  config.enter_server_host = [&] { return network->enter(NetworkPair::Host::kServer); };
  Run run(settings,
          {.sample_count = 10'000, .warm_up_count = 50, .turn_size = 500, .rest_part = 0.1},
          report);
  auto measured = run.measure(start_duel(config, [&](Duel& duel) {
    // Only this thread enters the client's host, and with it the sockets that it opens.
    const auto entered = network->enter(NetworkPair::Host::kClient);
    return entered ? duel.contenders() : unexpected{entered.error()};
  }));
  if (measured) run.report(head_of("two-node", config));
  return measured;
}

}  // namespace

void run_two_node(const Settings& settings, Report& report) {
  Settings chosen = settings;
  // Shared memory stays on one host.
  std::erase(chosen.carriers, Carrier::kSharedMemory);
  if (chosen.carriers.empty()) {
    report.fail("two-node", "only UDP and TCP run between two hosts; add --transport udp");
  }
  measure_each("two-node", chosen, report, false, measure);
}

}  // namespace rtpm::bench
