#include <sched.h>

#include <atomic>
#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"

// A caller of high priority at a pace beside messages of 1 MiB. The raw floor, too, is measured
// beside RTPM's large messages: the two differ only by RTPM's own work, while the kernel's work for
// these messages delays both.
namespace rtpm::bench {
namespace {

constexpr std::size_t kLargeSize = std::size_t{1} << 20;

/// Takes its turns with both CPUs kept awake, by threads that yield to all others (SCHED_IDLE).
/// Otherwise a load that keeps the CPUs from sleeping makes the measured caller quicker, which
/// hides the load's cost.
class AwakeContender final : public Contender {
 public:
  explicit AwakeContender(std::unique_ptr<Contender> inner) : inner_(std::move(inner)) {}

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    std::atomic<bool> is_over{false};
    std::vector<rt::Thread> threads;
    expected<void, std::string> taken;
    for (const int cpu : cpus_of(choose_placement())) {
      auto thread = rt::Thread::start(
          {.name = "bench-awake", .cpus = {cpu}, .realtime = rt::RealtimeMode::kOff}, [&is_over] {
            // The thread began with its starter's real-time policy, which it must not keep.
            const sched_param parameter{};
            if (sched_setscheduler(0, SCHED_IDLE, &parameter) != 0) return;
            while (!is_over.load(std::memory_order_relaxed)) {
            }
          });
      if (thread) {
        threads.push_back(std::move(*thread));
      } else {
        taken = unexpected{thread.error().text()};
      }
    }
    if (taken) taken = inner_->take_turn(plan, finding);
    is_over.store(true, std::memory_order_relaxed);
    return taken;
  }

 private:
  std::unique_ptr<Contender> inner_;
};

expected<Contenders, std::string> connect(Duel& duel, const DuelConfig& config) {
  Contenders contenders;
  for (const Side side : kBothSides) {
    std::vector servers{&duel.server(side)};
    if (side == Side::kFloor) servers.push_back(&duel.server(Side::kRtpm));
    const Running running(servers);
    auto high = duel.connect_high(side);
    if (!high) return unexpected{high.error()};
    auto large = connect_large_job(duel.low_node(), duel.rtpm_url(), kLowPriority, kLargeSize);
    if (!large) return unexpected{large.error()};
    auto load = std::make_unique<LowLoad>(config.placement, config.realtime,
                                          std::vector<Job>{std::move(*large)});
    contenders.push_back(std::make_unique<AwakeContender>(
        std::make_unique<CallContender>(servers, std::move(*high), std::move(load))));
  }
  return contenders;
}

expected<void, std::string> measure(const Settings& settings, const DuelConfig& sides,
                                    Report& report) {
  DuelConfig config = sides;
  config.low_caller_count = 1;
  Run run(settings,
          {.sample_count = 15'000,
           .warm_up_count = 20,
           .turn_size = settings.paced_count(0.05),
           .is_round_a_turn = true,
           .rest_part = 0.15,
           .rate_hz = settings.rate_hz,
           .loads = {0, 1},
           .load_field = "large_callers"},
          report);
  auto measured =
      run.measure(start_duel(config, [&](Duel& duel) { return connect(duel, config); }));
  if (measured) run.report(head_of("large", config));
  return measured;
}

}  // namespace

void run_large(const Settings& settings, Report& report) {
  measure_each("large", settings, report, true, measure);
}

}  // namespace rtpm::bench
