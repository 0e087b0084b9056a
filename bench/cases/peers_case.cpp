#include "cases/peers_case.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "runs/contender.hpp"
#include "runs/peer_table.hpp"
#include "runs/turn_run.hpp"

namespace rtpm::bench {
namespace {

// The figures are those of call_case.cpp, paced_case.cpp and loaded_run.cpp, where they are
// explained.
CasePlan call_plan() {
  return {.name = "call",
          .sample_count = 100'000,
          .warm_up_count = 50,
          .turn_size = 500,
          .rest_part = 0.1,
          .part_count = 5};
}

CasePlan paced_plan(const Settings& settings) {
  return {.name = "paced",
          .sample_count = 10'000,
          .warm_up_count = 5,
          .turn_size = static_cast<std::uint64_t>(std::max(1.0, 0.1 * settings.rate_hz)),
          .rate_hz = settings.rate_hz,
          .count_from = CountFrom::kDue};
}

CasePlan isolation_plan(const Settings& settings) {
  return {.name = "isolation",
          .sample_count = 10'000,
          .warm_up_count = 20,
          .turn_size = static_cast<std::uint64_t>(std::max(1.0, 0.1 * settings.rate_hz)),
          .rest_part = 0.15,
          .rate_hz = settings.rate_hz,
          .low_caller_counts = settings.low_caller_counts,
          .work = settings.work};
}

/// What a run with peers found, as results.
class CallResults {
 public:
  CallResults(const DuelConfig& config, const CasePlan& plan, const TurnRun& run)
      : config_(config), plan_(plan), run_(run) {}
  /// RTPM beside the floor, and each peer beside both, for each number of low-priority callers.
  void report(Report& report, const DisturbanceWatch& watch) const;

 private:
  using Entrant = TurnRun::Entrant;
  [[nodiscard]] Result result_of_rtpm(int low_callers) const;
  [[nodiscard]] Result result_of_peer(const Entrant& entrant, int low_callers) const;
  void add_load(JsonObject& json, const Entrant& entrant, int low_callers,
                const std::string& prefix) const;
  [[nodiscard]] const Samples& rtpm(int low_callers) const {
    return run_.entrants()[0].findings.at(low_callers).high;
  }
  [[nodiscard]] const Samples& floor(int low_callers) const {
    return run_.entrants()[1].findings.at(low_callers).high;
  }
  [[nodiscard]] std::string title(int low_callers) const;

  const DuelConfig& config_;
  const CasePlan& plan_;
  const TurnRun& run_;
};

std::string CallResults::title(int low_callers) const {
  std::string text = title_of(plan_.name, config_);
  if (plan_.rate_hz > 0) text += ", " + short_text(plan_.rate_hz) + " Hz";
  if (plan_.work != Duration{0}) {
    text +=
        ", " + std::to_string(low_callers) + " low-priority caller" + (low_callers == 1 ? "" : "s");
  }
  return text;
}

/// How far a contender's figures moved from its own idle ones, where these were measured, and what
/// its load met.
void CallResults::add_load(JsonObject& json, const Entrant& entrant, int low_callers,
                           const std::string& prefix) const {
  if (plan_.work == Duration{0}) return;
  const TurnRun::Finding& finding = entrant.findings.at(low_callers);
  const auto idle = entrant.findings.find(0);
  for (const auto& [key, percent] : {std::pair{"p50", 50.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    if (idle == entrant.findings.end()) break;
    const Ratio growth = ratio_at(finding.high, idle->second.high, percent);
    const std::string field = prefix + "loaded_over_idle_" + key;
    json.add(field, growth.middle);
    json.add(field + "_low", growth.low);
    json.add(field + "_high", growth.high);
  }
  if (finding.low.count() == 0) return;
  add_percentiles(json, prefix + "low_", finding.low.percentiles());
  json.add(prefix + "low_n", static_cast<std::int64_t>(finding.low.count()));
}

Result CallResults::result_of_rtpm(int low_callers) const {
  Result result{.title = title(low_callers)};
  add_comparison(result, plan_.name, config_, rtpm(low_callers), floor(low_callers));
  if (plan_.rate_hz > 0) result.json.add("rate_hz", plan_.rate_hz);
  if (plan_.work != Duration{0}) result.json.add("low_callers", low_callers);
  add_load(result.json, run_.entrants()[0], low_callers, "");
  add_load(result.json, run_.entrants()[1], low_callers, "floor_");
  for (const Entrant& entrant : run_.entrants()) {
    if (entrant.peer == nullptr) continue;
    const TurnRun::Finding& peer = entrant.findings.at(low_callers);
    result.rows.push_back({entrant.title, peer.high.percentiles()});
  }
  return result;
}

Result CallResults::result_of_peer(const Entrant& entrant, int low_callers) const {
  const TurnRun::Finding& finding = entrant.findings.at(low_callers);
  Result result;
  JsonObject& json = result.json;
  json.add("case", plan_.name);
  json.add("peer", entrant.peer->name());
  json.add("transport", entrant.peer->transport());
  json.add("payload", static_cast<std::int64_t>(kPayloadSize));
  json.add("n", static_cast<std::int64_t>(finding.high.count()));
  if (plan_.rate_hz > 0) json.add("rate_hz", plan_.rate_hz);
  if (plan_.work != Duration{0}) json.add("low_callers", low_callers);
  add_distribution(json, "", finding.high);
  json.add("rtpm_transport", to_string(config_.carrier));
  json.add("rtpm_wait", rt::to_string(config_.wait.strategy));
  add_distribution(json, "rtpm_", rtpm(low_callers));
  add_distribution(json, "floor_", floor(low_callers));
  add_ratios(json, "rtpm_over_peer_", rtpm(low_callers), finding.high);
  add_load(json, entrant, low_callers, "");
  add_load(json, run_.entrants()[0], low_callers, "rtpm_");
  add_rounds(result, rtpm(low_callers), finding.high);
  return result;
}

void CallResults::report(Report& report, const DisturbanceWatch& watch) const {
  for (const int low_callers : run_.low_caller_counts()) {
    Result result = result_of_rtpm(low_callers);
    watch.finish(result, longest_us(result));
    report.add(result);
    for (const Entrant& entrant : run_.entrants()) {
      if (entrant.peer == nullptr) continue;
      Result of_peer = result_of_peer(entrant, low_callers);
      watch.finish(of_peer, longest_us(result));
      report.add(of_peer);
    }
  }
}

expected<bool, std::string> measure_beside(const Settings& settings, const DuelConfig& config,
                                           const CasePlan& plan, const PeerChoice& choice,
                                           Report& report) {
  TurnRun run(settings, plan);
  DisturbanceWatch watch({});
  const std::vector<Rounds> parts = run.parts();
  for (const Rounds rounds : parts) {
    auto duel = Duel::start(config);
    if (!duel) return unexpected{duel.error()};
    run.start_peers(choice, "call", config.carrier,
                    {.placement = config.placement,
                     .realtime = config.realtime,
                     .low_caller_count = config.low_caller_count,
                     .work_ns = plan.work.count()});
    if (!run.has_peers()) return run.is_complete();
    auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
      auto rtpm = connect_contender(**duel, Side::kRtpm, config, plan.work);
      if (!rtpm) return unexpected{rtpm.error()};
      auto floor = connect_contender(**duel, Side::kFloor, config, plan.work);
      if (!floor) return unexpected{floor.error()};
      watch.follow((*duel)->server_ids());
      auto done = run.measure(std::move(*rtpm), std::move(*floor), config.placement, rounds);
      if (!done) return done;
      watch.note();
      if (rounds.end == parts.back().end) CallResults(config, plan, run).report(report, watch);
      return {};
    });
    run.end_part();
    if (!measured) return unexpected{measured.error()};
  }
  return run.is_complete();
}

bool run_with_peers(const Settings& settings, const CasePlan& plan, Report& report) {
  const auto choice = choose_peers(settings.peers);
  if (!choice) return false;
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .low_caller_count = *std::ranges::max_element(plan.low_caller_counts),
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      if (strategy == rt::WaitStrategy::kSpin && config.low_caller_count > 0) {
        say_not_measured(title_of(plan.name, config),
                         "a lane that spins would starve the low-priority lane on its CPU; use "
                         "--wait adaptive or --wait block");
        is_complete = false;
        continue;
      }
      const auto measured = measure_beside(settings, config, plan, *choice, report);
      if (!measured) say_not_measured(title_of(plan.name, config), measured.error());
      is_complete = measured && *measured && is_complete;
    }
  }
  return is_complete;
}

}  // namespace

bool say_missing_peers(const Settings& settings) {
  const auto choice = choose_peers(settings.peers);
  if (!choice) return false;
  bool is_complete = true;
  for (const PeerEntry* peer : choice->peers) {
    if (find_program(*peer)) continue;
    say_not_measured("peer " + std::string(peer->name), missing_text(*peer));
    if (choice->is_by_name) is_complete = false;
  }
  return is_complete;
}

bool run_call_with_peers(const Settings& settings, Report& report) {
  return run_with_peers(settings, call_plan(), report);
}

bool run_paced_with_peers(const Settings& settings, Report& report) {
  return run_with_peers(settings, paced_plan(settings), report);
}

bool run_isolation_with_peers(const Settings& settings, Report& report) {
  return run_with_peers(settings, isolation_plan(settings), report);
}

}  // namespace rtpm::bench
