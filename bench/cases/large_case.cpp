#include "cases/case.hpp"
#include "runs/loaded_run.hpp"

namespace rtpm::bench {
namespace {

constexpr std::size_t kLargeSize = std::size_t{1} << 20;

// The raw floor, too, is measured beside RTPM's large. So the two differ by what RTPM makes of it,
// while what the kernel does for the large delays both.
LoadPlan plan_of() {
  return {.case_name = "large",
          .field = "large_callers",
          .people = "large caller",
          .caller_counts = {0, 1},
          .connect = [](Duel& duel, Side) -> expected<std::vector<Job>, std::string> {
            auto job = duel.connect_large(kLargeSize);
            if (!job) return unexpected{job.error()};
            return std::vector<Job>{std::move(*job)};
          },
          .is_load_on_rtpm = true,
          .keeps_awake = true};
}

}  // namespace

bool run_large(const Settings& settings, Report& report) {
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .low_caller_count = 1,
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      if (strategy == rt::WaitStrategy::kSpin) {
        say_not_measured(title_of("large", config),
                         "a lane that spins would starve the large's lane on its CPU; use "
                         "--wait adaptive or --wait block");
        is_complete = false;
        continue;
      }
      if (auto measured = measure_loaded(settings, config, plan_of(), report); !measured) {
        say_not_measured(title_of("large", config), measured.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
