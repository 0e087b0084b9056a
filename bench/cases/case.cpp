#include "cases/case.hpp"

#include <array>

namespace rtpm::bench {

std::span<const Case> cases() {
  static constexpr std::array<Case, 11> kCases{{
      {"call", "48-byte calls one after the other, beside raw sockets with the same wait", false,
       measure_calls},
      {"paced", "48-byte calls at a fixed rate, timed from when each was due", false,
       measure_paced},
      {"isolation",
       "a 1 kHz caller of high priority while low-priority callers saturate the server", true,
       measure_isolation},
      {"events", "32-byte events at 1 kHz through a hub to 1…256 consumers, beside a raw relay",
       false, measure_events},
      {"throughput", "48-byte calls, many on their way at a time, beside a raw UDP socket", false,
       measure_throughput},
      {"two-node", "48-byte calls between two network namespaces", false, measure_two_node},
      {"device", "a 1 kHz force loop through a simulated device, beside two raw echoes", true,
       measure_device},
      {"scale", "48-byte calls while 1…1000 clients are bound, and the server's memory", false,
       measure_scale},
      {"startup", "from a server's program start to the first answered call", false,
       measure_startup},
      {"memory", "what a server has in memory with 0, 1 and 100 bound clients", false,
       measure_memory},
      {"idle", "what CPU time an idle server takes", false, measure_idle},
  }};
  return kCases;
}

void run_case(const Case& each, const Settings& settings, Report& report) {
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      DuelConfig config{.carrier = carrier,
                        .wait = {.strategy = strategy},
                        .placement = choose_placement(),
                        .realtime = settings.realtime};
      Outcome<> measured;
      if (each.shares_cpu && strategy == rt::WaitStrategy::kSpin) {
        measured = failure(
            "what spins would starve what shares its CPU; use --wait adaptive or --wait block");
      } else if (settings.is_sealed) {
        auto keys = SealedKeys::make(config.host);
        if (keys) config.keys = std::move(*keys);
        if (!keys) measured = failure(keys.error());
      }
      if (measured) measured = each.measure(settings, config, report);
      if (measured) continue;
      report.fail(std::string(each.name) + ", " + std::string(to_string(carrier)) + ", " +
                      std::string(rt::to_string(strategy)) + " wait",
                  measured.error());
    }
  }
}

}  // namespace rtpm::bench
