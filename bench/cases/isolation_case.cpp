#include <algorithm>
#include <optional>
#include <vector>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "runs/loaded_run.hpp"

namespace rtpm::bench {
namespace {

LoadPlan plan_of(const Settings& settings, int caller_count_max) {
  return {.case_name = "isolation",
          .field = "low_callers",
          .people = "low-priority caller",
          .caller_counts = settings.low_caller_counts,
          .connect = [caller_count_max, work = settings.work](
                         Duel& duel, Side) -> expected<std::vector<Job>, std::string> {
            std::vector<Job> jobs;
            for (int i = 0; i < caller_count_max; ++i) {
              auto caller = duel.connect_low();
              if (!caller) return unexpected{caller.error()};
              // Shared, because a job is copied.
              jobs.emplace_back([held = std::shared_ptr<Caller>(std::move(*caller)), work] {
                return held->work(work);
              });
            }
            return jobs;
          },
          .work = settings.work};
}

/// What stands beside a carrier: its own raw floor, and for shared memory also two raw sockets, as
/// a program would have that serves two priorities without RTPM.
std::vector<std::optional<Carrier>> floors_beside(Carrier carrier) {
  if (carrier == Carrier::kSharedMemory) return {Carrier::kUdp, std::nullopt};
  return {std::nullopt};
}

bool measure_beside(const Settings& settings, const DuelConfig& config, Report& report) {
  if (config.wait.strategy == rt::WaitStrategy::kSpin) {
    say_not_measured(title_of("isolation", config),
                     "a lane that spins would starve the low-priority lane on its CPU; use "
                     "--wait adaptive or --wait block");
    return false;
  }
  const LoadPlan plan = plan_of(settings, config.low_caller_count);
  const auto measured = measure_loaded(settings, config, plan, report);
  if (!measured) say_not_measured(title_of("isolation", config), measured.error());
  return measured.has_value();
}

}  // namespace

bool run_isolation(const Settings& settings, Report& report) {
  if (!settings.peers.empty()) return run_isolation_with_peers(settings, report);
  const int low_caller_count =
      *std::max_element(settings.low_caller_counts.begin(), settings.low_caller_counts.end());
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      for (const std::optional<Carrier> floor_carrier : floors_beside(carrier)) {
        const DuelConfig config{.carrier = carrier,
                                .floor_carrier = floor_carrier,
                                .wait = {.strategy = strategy, .spin = settings.spin},
                                .low_caller_count = low_caller_count,
                                .placement = choose_placement(),
                                .realtime = settings.realtime};
        is_complete = measure_beside(settings, config, report) && is_complete;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
