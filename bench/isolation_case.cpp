#include <algorithm>
#include <array>
#include <map>

#include "case.hpp"
#include "disturbance.hpp"
#include "duel.hpp"
#include "low_load.hpp"
#include "paced_calls.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

constexpr std::uint64_t kSampleCountDefault = 10'000;
constexpr int kWarmUpCount = 20;
/// How long a server is saturated at a stretch, and the part of that time for which both CPUs then
/// rest. Real-time threads that leave nothing to others for about a second are throttled by the
/// kernel, which would be measured instead.
constexpr double kTurnS = 0.4;
constexpr double kRestPart = 0.25;

/// What one side showed under one load.
struct Finding {
  Samples high;
  Samples low;
};
using Level = std::array<Finding, 2>;  ///< By Side.

/// One side's connections: the measured caller and the low-priority ones.
struct Connections {
  std::unique_ptr<Caller> high;
  std::unique_ptr<LowLoad> low;
};

class IsolationRun {
 public:
  IsolationRun(const Settings& settings, const DuelConfig& config, Duel& duel);

  [[nodiscard]] expected<void, std::string> measure();
  void add_results(Report& report, const DisturbanceWatch& watch) const;

 private:
  [[nodiscard]] expected<void, std::string> connect(Side side);
  [[nodiscard]] expected<void, std::string> measure_turn(Side side, int low_caller_count,
                                                         std::size_t count);
  [[nodiscard]] expected<void, std::string> measure_level(int low_caller_count, int round);
  [[nodiscard]] Result result_of(int low_caller_count) const;
  void add_growth(Result& result, Side side, std::string_view prefix, const Level& level) const;

  const Settings& settings_;
  const DuelConfig& config_;
  Duel& duel_;
  std::size_t count_per_round_;
  std::map<int, Level> levels_;
  std::array<Connections, 2> connections_;
};

std::size_t index_of(Side side) {
  return static_cast<std::size_t>(side);
}

IsolationRun::IsolationRun(const Settings& settings, const DuelConfig& config, Duel& duel)
    : settings_(settings), config_(config), duel_(duel) {
  const std::uint64_t count =
      settings.sample_count == 0 ? kSampleCountDefault : settings.sample_count;
  count_per_round_ = static_cast<std::size_t>(
      std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count)));
  const auto make_finding = [&] {
    return Finding{Samples(settings.round_count, count_per_round_),
                   Samples(settings.round_count, 0)};
  };
  // The idle server is what every load is compared with, so it is measured in any case.
  std::vector<int> counts = settings.low_caller_counts;
  counts.push_back(0);
  for (const int callers : counts) {
    levels_.try_emplace(callers, Level{make_finding(), make_finding()});
  }
}

expected<void, std::string> IsolationRun::connect(Side side) {
  Connections& connections = connections_[index_of(side)];
  duel_.take_turn(side);
  auto high = duel_.connect_high();
  if (!high) return unexpected{high.error()};
  connections.high = std::move(*high);
  auto low = LowLoad::connect(duel_, config_, settings_.work);
  if (!low) return unexpected{low.error()};
  connections.low = std::move(*low);
  return {};
}

expected<void, std::string> IsolationRun::measure_turn(Side side, int low_caller_count,
                                                       std::size_t count) {
  Finding& finding = levels_.at(low_caller_count)[index_of(side)];
  Caller& high = *connections_[index_of(side)].high;
  LowLoad& low = *connections_[index_of(side)].low;
  duel_.take_turn(side);
  if (auto started = low.start(low_caller_count); !started) {
    (void)low.stop();
    return started;
  }
  expected<void, std::string> called;
  for (int i = 0; i < kWarmUpCount && called; ++i)
    called = high.echo();
  const Duration period{static_cast<Duration::rep>(1e9 / settings_.rate_hz)};
  if (called) called = call_paced(high, period, count, CountFrom::kSent, finding.high);
  const auto latencies = low.stop();
  duel_.end_turn();
  if (!called) return called;
  if (!latencies) return unexpected{latencies.error()};
  for (const Duration latency : *latencies)
    finding.low.add(latency);
  const Duration turn = period * static_cast<Duration::rep>(count);
  rt::sleep_until(rt::now() + std::chrono::duration_cast<Duration>(turn * kRestPart));
  return {};
}

expected<void, std::string> IsolationRun::measure_level(int low_caller_count, int round) {
  const auto turn_size =
      std::max<std::size_t>(1, static_cast<std::size_t>(kTurnS * settings_.rate_hz));
  for (Finding& finding : levels_.at(low_caller_count)) {
    finding.high.begin_round(round);
    finding.low.begin_round(round);
  }
  // Who goes first changes from turn to turn.
  std::size_t first = 0;
  for (std::size_t done = 0; done < count_per_round_; done += turn_size, ++first) {
    const std::size_t count = std::min(turn_size, count_per_round_ - done);
    for (std::size_t i = 0; i < 2; ++i) {
      const Side side = kBothSides[(i + first) % 2];
      if (auto measured = measure_turn(side, low_caller_count, count); !measured) return measured;
    }
  }
  return {};
}

expected<void, std::string> IsolationRun::measure() {
  for (const Side side : kBothSides) {
    if (auto connected = connect(side); !connected) return connected;
  }
  for (int round = 0; round < settings_.round_count; ++round) {
    for (const auto& [callers, level] : levels_) {
      if (auto measured = measure_level(callers, round); !measured) return measured;
    }
  }
  return {};
}

/// How far a side's figures moved from its own idle ones.
void IsolationRun::add_growth(Result& result, Side side, std::string_view prefix,
                              const Level& level) const {
  const std::string begin(prefix);
  const std::string name = side == Side::kRtpm ? "RTPM" : "the raw floor";
  const Samples& idle = levels_.at(0)[index_of(side)].high;
  const Percentiles idle_values = idle.percentiles();
  result.json.add(begin + "idle_p50_us", idle_values.p50);
  result.json.add(begin + "idle_p99_us", idle_values.p99);
  result.json.add(begin + "idle_p999_us", idle_values.p999);
  const Samples& high = level[index_of(side)].high;
  std::string grown;
  for (const auto& [key, percent] : {std::pair{"p50", 50.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    const double growth = ratio_at(high, idle, percent).median;
    result.json.add(begin + "loaded_over_idle_" + key, growth);
    grown += std::string(grown.empty() ? "" : ", ") + short_text(growth) + " at " + key;
  }
  const Samples& low = level[index_of(side)].low;
  if (low.count() == 0) return;
  result.rows.push_back({name + ", idle", idle_values});
  result.rows.push_back({name + ", low callers", low.percentiles()});
  const double work_us = std::chrono::duration<double, std::micro>(settings_.work).count();
  const double low_p50 = low.percentiles().p50 / work_us;
  const double low_p99 = low.percentiles().p99 / work_us;
  add_percentiles(result.json, begin + "low_", low.percentiles());
  result.json.add(begin + "low_growth_p50", low_p50);
  result.json.add(begin + "low_growth_p99", low_p99);
  result.notes.push_back(name + " loaded over idle: " + grown + "; low callers over their work: " +
                         short_text(low_p50) + " at p50, " + short_text(low_p99) + " at p99");
}

Result IsolationRun::result_of(int low_caller_count) const {
  const Level& level = levels_.at(low_caller_count);
  Result result{.title =
                    title_of("isolation", config_) + ", " + std::to_string(low_caller_count) +
                    (low_caller_count == 1 ? " low-priority caller" : " low-priority callers")};
  add_comparison(result, "isolation", config_, level[index_of(Side::kRtpm)].high,
                 level[index_of(Side::kFloor)].high);
  result.json.add("low_callers", low_caller_count);
  result.json.add("rate_hz", settings_.rate_hz);
  result.json.add("work_us", std::chrono::duration<double, std::micro>(settings_.work).count());
  add_growth(result, Side::kRtpm, "", level);
  add_growth(result, Side::kFloor, "floor_", level);
  return result;
}

void IsolationRun::add_results(Report& report, const DisturbanceWatch& watch) const {
  for (const auto& [count, level] : levels_) {
    Result result = result_of(count);
    watch.finish(result, longest_us(result));
    report.add(result);
  }
}

expected<void, std::string> measure_one(const Settings& settings, const DuelConfig& config,
                                        Report& report) {
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  IsolationRun run(settings, config, **duel);
  return run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    if (auto measured = run.measure(); !measured) return measured;
    run.add_results(report, watch);
    return {};
  });
}

}  // namespace

bool run_isolation(const Settings& settings, Report& report) {
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
      if (auto measured = measure_one(settings, config, report); !measured) {
        say_not_measured(title_of("isolation", config), measured.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
