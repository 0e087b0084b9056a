#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"
#include "sides/hello_storm.hpp"
#include "sides/standalone.hpp"

// Calls beside the raw floor and, where asked for, beside peers: one after the other, at a pace,
// and at a pace beside callers of low priority.
namespace rtpm::bench {
namespace {

/// Call counts by payload size: how many are worth their time, and how many one side makes before
/// the other's turn. A turn is short enough that both sides see the same minutes, and that none
/// fills a second, after which the kernel throttles real-time threads. RTPM's threads avoid that
/// throttling, the floor's do not: so each turn is followed by a pause.
struct Amount {
  std::size_t payload_size_max;
  std::uint64_t sample_count;
  std::uint64_t turn_size;
  std::uint64_t warm_up_count;
};
constexpr std::array<Amount, 3> kAmounts{{{std::size_t{16} * 1024, 100'000, 500, 50},
                                          {std::size_t{256} * 1024, 10'000, 100, 10},
                                          {SIZE_MAX, 1'000, 20, 2}}};

/// How long a call of low priority computes.
constexpr Duration kLowWork = std::chrono::microseconds{200};

/// @param duel  set to the servers of the last part, which stay until it ends
expected<void, std::string> measure(const Settings& settings, const DuelConfig& config,
                                    Duration work, Run& run, std::shared_ptr<Duel>& duel) {
  if (!settings.peers.empty()) {
    run.invite(chosen_peers(settings), "call", config.carrier,
               {.placement = config.placement,
                .realtime = config.realtime,
                .low_caller_count = config.low_caller_count,
                .work_ns = work.count()});
  }
  return run.measure([&]() -> expected<Connect, std::string> {
    duel.reset();
    auto started = Duel::start(config);
    if (!started) return unexpected{started.error()};
    duel = *started;
    return Connect([&] { return duel->contenders(work); });
  });
}

expected<void, std::string> measure_calls(const Settings& settings, const DuelConfig& sides,
                                          Report& report) {
  const bool has_peers = !settings.peers.empty();
  DuelConfig config = sides;
  for (const std::size_t payload_size : settings.payload_sizes) {
    // Peers know one payload.
    if (!has_peers) config.payload_size = payload_size;
    const Amount& amount = *std::ranges::find_if(
        kAmounts, [&](const Amount& each) { return config.payload_size <= each.payload_size_max; });
    Run run(settings,
            {.sample_count = amount.sample_count,
             .warm_up_count = amount.warm_up_count,
             .turn_size = amount.turn_size,
             .rest_part = 0.1,
             .part_count = has_peers ? 5 : 20},
            report);
    std::shared_ptr<Duel> duel;
    if (auto measured = measure(settings, config, {}, run, duel); !measured) return measured;
    run.report(head_of("call", config));
  }
  return {};
}

expected<void, std::string> measure_paced(const Settings& settings, const DuelConfig& config,
                                          Report& report) {
  // The floor spins where RTPM predicts the caller's period, too.
  const bool is_spun = config.wait.strategy == rt::WaitStrategy::kSpin ||
                       config.wait.strategy == rt::WaitStrategy::kPeriodic;
  // A server that was stopped has to estimate a caller's period anew in each turn.
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 5,
           .turn_size = settings.paced_count(0.25),
           .is_round_a_turn = true,
           .rest_part = is_spun ? 0.15 : 0,
           .rate_hz = settings.rate_hz,
           .count_from = CountFrom::kDue},
          report);
  std::shared_ptr<Duel> duel;
  if (auto measured = measure(settings, config, {}, run, duel); !measured) return measured;
  // The server runs only in its own turns.
  const std::chrono::duration<double> cpu_time = cpu_time_of(duel->server(Side::kRtpm).id());
  run.report(head_of("paced", config),
             {{"server_cpu_percent", rounded(100 * cpu_time.count() / run.paced_seconds())}});
  return {};
}

/// Returns the floors to compare a carrier with: its own raw floor (nullopt means the same
/// carrier), and for shared memory also two raw sockets, as a program without RTPM would use for
/// two priorities.
std::vector<std::optional<Carrier>> floors_beside(const Settings& settings, Carrier carrier) {
  if (carrier != Carrier::kSharedMemory || !settings.peers.empty()) return {std::nullopt};
  return {Carrier::kUdp, std::nullopt};
}

// Measures a loop at the requested rate, alone and while 1000 HELLOs a second arrive.
expected<void, std::string> measure_hello_storm(const Settings& settings, const DuelConfig& sides,
                                                Report& report) {
  DuelConfig config = sides;
  config.has_hello_storm = true;
  Run run(settings,
          {.sample_count = 60'000,
           .warm_up_count = 20,
           .turn_size = settings.paced_count(0.2),
           .is_round_a_turn = true,
           .rest_part = 0.15,
           .rate_hz = settings.rate_hz,
           .loads = {0, 1},
           .load_field = "hello_storms"},
          report);
  std::shared_ptr<Duel> duel;
  if (auto measured = measure(settings, config, {}, run, duel); !measured) return measured;
  Json head = head_of("isolation", config);
  head["hellos_per_second"] = kHellosPerSecond;
  run.report(head);
  return {};
}

expected<void, std::string> measure_isolation(const Settings& settings, const DuelConfig& sides,
                                              Report& report) {
  const std::vector<int>& loads = settings.low_caller_counts;
  DuelConfig config = sides;
  config.low_caller_count = *std::ranges::max_element(loads);
  for (const std::optional<Carrier> floor : floors_beside(settings, config.carrier)) {
    config.floor_carrier = floor;
    // Per load, or over all loads if they are few: a p99.9 needs many samples.
    Run run(settings,
            {.sample_count = std::max<std::uint64_t>(10'000, 30'000 / loads.size()),
             .warm_up_count = 20,
             .turn_size = settings.paced_count(settings.peers.empty() ? 0.05 : 0.1),
             .is_round_a_turn = true,
             .rest_part = 0.15,
             .rate_hz = settings.rate_hz,
             .loads = loads,
             .load_field = "low_callers"},
            report);
    std::shared_ptr<Duel> duel;
    auto measured = measure(settings, config, kLowWork, run, duel);
    if (!measured) return measured;
    Json head = head_of("isolation", config);
    head["work_us"] = std::chrono::duration<double, std::micro>(kLowWork).count();
    run.report(head);
  }
  return {};
}

}  // namespace

void run_call(const Settings& settings, Report& report) {
  measure_each("call", settings, report, false, measure_calls);
}

void run_paced(const Settings& settings, Report& report) {
  measure_each("paced", settings, report, false, measure_paced);
}

void run_isolation(const Settings& settings, Report& report) {
  measure_each("isolation", settings, report, true,
               settings.is_sealed ? measure_hello_storm : measure_isolation);
}

}  // namespace rtpm::bench
