#include <algorithm>

#include "case.hpp"
#include "loaded_run.hpp"
#include "peers_case.hpp"

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

}  // namespace

bool run_isolation(const Settings& settings, Report& report) {
  if (!settings.peers.empty()) return run_isolation_with_peers(settings, report);
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const int low_caller_count =
          *std::max_element(settings.low_caller_counts.begin(), settings.low_caller_counts.end());
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .low_caller_count = low_caller_count,
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      if (strategy == rt::WaitStrategy::kSpin) {
        say_not_measured(title_of("isolation", config),
                         "a lane that spins would starve the low-priority lane on its CPU; use "
                         "--wait adaptive or --wait block");
        is_complete = false;
        continue;
      }
      const LoadPlan plan = plan_of(settings, low_caller_count);
      if (auto measured = measure_loaded(settings, config, plan, report); !measured) {
        say_not_measured(title_of("isolation", config), measured.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
