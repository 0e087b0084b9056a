#include "runs/loaded_run.hpp"

#include <sched.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "runs/paced_calls.hpp"

namespace rtpm::bench {
namespace {

/// For each load, or for all together if there are few: a p99.9 takes many.
constexpr std::size_t kSampleCountDefault = 10'000;
constexpr std::size_t kSampleCountDefaultOfAll = 30'000;
constexpr int kWarmUpCount = 20;
/// How long a server is saturated at a stretch.
constexpr double kTurnS = 0.05;
/// The idle server may be measured only to be compared with. Then so many rounds will do.
constexpr int kRoundsPerIdleRound = 4;

std::size_t index_of(Side side) {
  return static_cast<std::size_t>(side);
}

}  // namespace

expected<void, std::string> AwakeCpus::start(const Placement& placement) {
  for (const int cpu : {placement.client_cpu, placement.server_cpu}) {
    auto thread = rt::Thread::start(
        {.name = "bench-awake", .cpus = {cpu}, .realtime = rt::RealtimeMode::kOff}, [this] {
          // It began with its starter's real-time policy, with which it must not stay.
          const sched_param parameter{};
          if (sched_setscheduler(0, SCHED_IDLE, &parameter) != 0) return;
          while (!is_over_.load(std::memory_order_relaxed)) {
          }
        });
    if (!thread) return unexpected{thread.error().text()};
    threads_.push_back(std::move(*thread));
  }
  return {};
}

AwakeCpus::~AwakeCpus() {
  is_over_.store(true, std::memory_order_relaxed);
}

LoadedRun::LoadedRun(const Settings& settings, const DuelConfig& config, const LoadPlan& plan,
                     Duel& duel)
    : settings_(settings), config_(config), plan_(plan), duel_(duel) {
  auto count = static_cast<std::size_t>(settings.sample_count);
  if (count == 0) {
    const std::size_t load_count = std::max<std::size_t>(1, plan.caller_counts.size());
    count = std::max(kSampleCountDefault, kSampleCountDefaultOfAll / load_count);
  }
  // A round is a turn of each side: where the machine stood still, little is lost.
  const auto turn_size =
      std::max<std::size_t>(1, static_cast<std::size_t>(kTurnS * settings.rate_hz));
  round_count_ =
      std::max(settings.round_count, static_cast<int>((count + turn_size - 1) / turn_size));
  count_per_round_ = std::max<std::size_t>(1, count / static_cast<std::size_t>(round_count_));
  const auto make_finding = [&] {
    return Finding{Samples(round_count_, count_per_round_), Samples(round_count_, 0)};
  };
  // The idle server is what every load is compared with, so it is measured in any case.
  std::vector<int> counts = plan.caller_counts;
  counts.push_back(0);
  for (const int callers : counts) {
    levels_.try_emplace(callers, Level{make_finding(), make_finding()});
  }
}

expected<void, std::string> LoadedRun::connect(Side side) {
  Connections& connections = connections_[index_of(side)];
  duel_.take_turn(side);
  auto high = duel_.connect_high();
  if (!high) return unexpected{high.error()};
  connections.high = std::move(*high);
  if (plan_.is_load_on_rtpm) duel_.join_rtpm();
  auto jobs = plan_.connect(duel_, side);
  if (!jobs) return unexpected{jobs.error()};
  connections.low =
      std::make_unique<LowLoad>(config_.placement, config_.realtime, std::move(*jobs));
  return {};
}

expected<void, std::string> LoadedRun::measure_turn(Side side, int caller_count) {
  Finding& finding = levels_.at(caller_count)[index_of(side)];
  Caller& high = *connections_[index_of(side)].high;
  LowLoad& low = *connections_[index_of(side)].low;
  duel_.take_turn(side);
  if (plan_.is_load_on_rtpm && caller_count > 0) duel_.join_rtpm();
  std::optional<AwakeCpus> awake;
  if (plan_.keeps_awake) {
    if (auto started = awake.emplace().start(config_.placement); !started) return started;
  }
  if (auto started = low.start(caller_count); !started) {
    (void)low.stop();
    return started;
  }
  expected<void, std::string> called;
  for (int i = 0; i < kWarmUpCount && called; ++i)
    called = high.echo();
  const Duration period{static_cast<Duration::rep>(1e9 / settings_.rate_hz)};
  if (called) called = call_paced(high, period, count_per_round_, CountFrom::kSent, finding.high);
  const auto latencies = low.stop();
  awake.reset();
  duel_.rest_after(period * static_cast<Duration::rep>(count_per_round_));
  if (!called) return called;
  if (!latencies) return unexpected{latencies.error()};
  for (const Duration latency : *latencies)
    finding.low.add(latency);
  return {};
}

expected<void, std::string> LoadedRun::measure_level(int caller_count, int round) {
  for (Finding& finding : levels_.at(caller_count)) {
    finding.high.begin_round(round);
    finding.low.begin_round(round);
  }
  const RoundWatch round_watch(&detector_);
  // Who goes first changes from round to round.
  for (std::size_t i = 0; i < 2; ++i) {
    const Side side = kBothSides[(i + static_cast<std::size_t>(round)) % 2];
    if (auto measured = measure_turn(side, caller_count); !measured) return measured;
  }
  const bool was_disturbed = round_watch.was_disturbed();
  for (Finding& finding : levels_.at(caller_count)) {
    finding.high.note_disturbed(was_disturbed);
    finding.low.note_disturbed(was_disturbed);
  }
  return {};
}

expected<void, std::string> LoadedRun::measure(DisturbanceWatch& watch) {
  if (auto started = detector_.start(cpus_of(config_.placement)); !started) return started;
  for (const Side side : kBothSides) {
    if (auto connected = connect(side); !connected) return connected;
  }
  for (int round = 0; round < round_count_; ++round) {
    for (const auto& [callers, level] : levels_) {
      if (callers == 0 && !is_asked(0) && round % kRoundsPerIdleRound != 0) continue;
      if (auto measured = measure_level(callers, round); !measured) return measured;
    }
    watch.end_round();
  }
  return {};
}

/// How far a side's figures moved from its own idle ones.
void LoadedRun::add_growth(Result& result, Side side, std::string_view prefix,
                           const Level& level) const {
  const std::string begin(prefix);
  const std::string name = side == Side::kRtpm ? "RTPM" : "the raw floor";
  const Samples& idle = levels_.at(0)[index_of(side)].high;
  const Percentiles idle_values = idle.percentiles();
  result.json.add(begin + "idle_p50_us", idle_values.p50);
  result.json.add(begin + "idle_p99_us", idle_values.p99);
  result.json.add(begin + "idle_p999_us", idle_values.p999);
  const Finding& finding = level[index_of(side)];
  std::string grown;
  for (const auto& [key, percent] : {std::pair{"p50", 50.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    const Ratio growth = ratio_at(finding.high, idle, percent);
    const std::string field = begin + "loaded_over_idle_" + key;
    result.json.add(field, growth.middle);
    result.json.add(field + "_low", growth.low);
    result.json.add(field + "_high", growth.high);
    result.json.add(begin + "rounds_loaded_over_idle_" + key, growth.stretches);
    grown += std::string(grown.empty() ? "" : ", ") + short_text(growth.middle) + " at " + key;
  }
  if (finding.low.count() == 0) return;
  result.rows.push_back({name + ", idle", idle_values});
  result.notes.push_back(name + " loaded over idle: " + grown);
  add_load(result, side, prefix, finding.low);
}

/// What the callers of low priority met themselves.
void LoadedRun::add_load(Result& result, Side side, std::string_view prefix,
                         const Samples& low) const {
  const std::string begin(prefix);
  const std::string name = side == Side::kRtpm ? "RTPM" : "the raw floor";
  const Percentiles values = low.percentiles();
  result.rows.push_back({name + ", " + plan_.people, values});
  add_distribution(result.json, begin + "low_", low);
  result.json.add(begin + "low_n", static_cast<std::int64_t>(low.count()));
  if (plan_.work == Duration{0}) return;
  const double work_us = std::chrono::duration<double, std::micro>(plan_.work).count();
  result.json.add(begin + "low_growth_p50", values.p50 / work_us);
  result.json.add(begin + "low_growth_p99", values.p99 / work_us);
  result.notes.back() += "; " + plan_.people +
                         "s over their work: " + short_text(values.p50 / work_us) + " at p50, " +
                         short_text(values.p99 / work_us) + " at p99";
}

Result LoadedRun::result_of(int caller_count) const {
  const Level& level = levels_.at(caller_count);
  Result result{.title = title_of(plan_.case_name, config_) + ", " + std::to_string(caller_count) +
                         " " + plan_.people + (caller_count == 1 ? "" : "s")};
  add_comparison(result, plan_.case_name, config_, level[index_of(Side::kRtpm)].high,
                 level[index_of(Side::kFloor)].high);
  result.json.add(plan_.field, caller_count);
  result.json.add("rate_hz", settings_.rate_hz);
  if (plan_.work != Duration{0}) {
    result.json.add("work_us", std::chrono::duration<double, std::micro>(plan_.work).count());
  }
  if (settings_.tells_latencies) {
    add_latencies(result, level[index_of(Side::kRtpm)].high, level[index_of(Side::kFloor)].high);
  }
  add_growth(result, Side::kRtpm, "", level);
  add_growth(result, Side::kFloor, "floor_", level);
  return result;
}

bool LoadedRun::is_asked(int caller_count) const {
  return std::ranges::find(plan_.caller_counts, caller_count) != plan_.caller_counts.end();
}

std::vector<Result> LoadedRun::results() const {
  std::vector<Result> results;
  for (const auto& [count, level] : levels_) {
    if (is_asked(count)) results.push_back(result_of(count));
  }
  return results;
}

expected<void, std::string> measure_loaded(const Settings& settings, const DuelConfig& config,
                                           const LoadPlan& plan, Report& report) {
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  LoadedRun run(settings, config, plan, **duel);
  return run_as_caller(config, [&]() -> expected<void, std::string> {
    DisturbanceWatch watch((*duel)->server_ids());
    if (auto measured = run.measure(watch); !measured) return measured;
    for (Result& result : run.results()) {
      watch.finish(result, longest_us(result));
      report.add(result);
    }
    return {};
  });
}

}  // namespace rtpm::bench
