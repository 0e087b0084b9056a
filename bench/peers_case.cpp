#include "peers_case.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "case.hpp"
#include "contender.hpp"
#include "disturbance.hpp"
#include "peer_contender.hpp"
#include "peer_table.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

/// What a case has its contenders do.
struct CasePlan {
  std::string_view name;
  std::uint64_t sample_count = 0;   ///< Of each contender, if the run does not say.
  std::uint64_t warm_up_count = 0;  ///< Before each turn.
  std::uint64_t turn_size = 0;      ///< Calls of one contender before the next one's turn.
  double rest_part = 0;             ///< Of a turn's time, for which the CPUs then rest.
  double rate_hz = 0;               ///< 0: one call after the other.
  CountFrom count_from = CountFrom::kSent;
  std::vector<int> low_caller_counts{0};
  Duration work{0};
};

// The figures are those of call_case.cpp, paced_case.cpp and loaded_run.cpp, where they are
// explained.
CasePlan call_plan() {
  return {.name = "call",
          .sample_count = 100'000,
          .warm_up_count = 50,
          .turn_size = 500,
          .rest_part = 0.1};
}

CasePlan paced_plan(const Settings& settings) {
  return {.name = "paced",
          .sample_count = 10'000,
          .warm_up_count = 5,
          .turn_size = static_cast<std::uint64_t>(std::max(1.0, 0.5 * settings.rate_hz)),
          .rate_hz = settings.rate_hz,
          .count_from = CountFrom::kDue};
}

CasePlan isolation_plan(const Settings& settings) {
  CasePlan plan{.name = "isolation",
                .sample_count = 10'000,
                .warm_up_count = 20,
                .turn_size = static_cast<std::uint64_t>(std::max(1.0, 0.4 * settings.rate_hz)),
                .rest_part = 0.25,
                .rate_hz = settings.rate_hz,
                .low_caller_counts = settings.low_caller_counts,
                .work = settings.work};
  // The idle server is what every load is compared with, so it is measured in any case.
  plan.low_caller_counts.push_back(0);
  return plan;
}

/// What one contender showed with so many callers of low priority.
struct Finding {
  Samples high;
  Samples low;
};

/// A contender and what it showed by numbers of low-priority callers.
struct Entrant {
  std::unique_ptr<Contender> contender;
  const PeerContender* peer;  ///< Null: RTPM or the floor.
  std::map<int, Finding> findings{};
};

void add_peer_ratios(JsonObject& json, const Samples& rtpm, const Samples& peer) {
  for (const auto& [key, percent] :
       {std::pair{"p50", 50.0}, {"p90", 90.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    const Ratio ratio = ratio_at(rtpm, peer, percent);
    const std::string field = std::string("rtpm_over_peer_") + key;
    json.add(field, ratio.median);
    json.add(field + "_low", ratio.low);
    json.add(field + "_high", ratio.high);
  }
}

class PeersRun {
 public:
  PeersRun(const Settings& settings, const DuelConfig& config, const CasePlan& plan)
      : settings_(settings),
        config_(config),
        plan_(plan),
        levels_(plan.low_caller_counts.begin(), plan.low_caller_counts.end()) {
    const std::uint64_t count =
        settings.sample_count == 0 ? plan.sample_count : settings.sample_count;
    count_per_round_ =
        std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count));
  }

  /// Starts the peers, those that are asked for and can be had.
  void start_peers(const PeerChoice& choice);
  [[nodiscard]] bool has_peers() const noexcept { return !entrants_.empty(); }
  /// Connects RTPM and the floor, and measures all by turns.   On a thread as run_as_caller() has
  /// it.
  [[nodiscard]] expected<void, std::string> measure(Duel& duel);
  /// RTPM beside the floor, and each peer beside both, for each number of low-priority callers.
  void report(Report& report, const DisturbanceWatch& watch) const;
  [[nodiscard]] bool is_complete() const noexcept { return is_complete_; }

 private:
  void enter(std::unique_ptr<Contender> contender, const PeerContender* peer);
  [[nodiscard]] expected<void, std::string> measure_level(int low_callers, int round);
  [[nodiscard]] expected<void, std::string> take_turn(Entrant& entrant, int low_callers,
                                                      std::uint64_t count);
  void leave_out(const Entrant& entrant, const std::string& why);
  [[nodiscard]] Result result_of_rtpm(int low_callers) const;
  [[nodiscard]] Result result_of_peer(const Entrant& peer, int low_callers) const;
  void add_load(JsonObject& json, const Entrant& entrant, int low_callers,
                const std::string& prefix) const;
  [[nodiscard]] const Finding& rtpm(int low_callers) const {
    return entrants_[0].findings.at(low_callers);
  }
  [[nodiscard]] const Finding& floor(int low_callers) const {
    return entrants_[1].findings.at(low_callers);
  }
  [[nodiscard]] std::string title(int low_callers) const;

  const Settings& settings_;
  const DuelConfig& config_;
  const CasePlan& plan_;
  std::set<int> levels_;  ///< Numbers of low-priority callers.
  std::uint64_t count_per_round_ = 0;
  std::vector<Entrant> entrants_{};  ///< While it is measured: RTPM, the floor, the peers.
  bool is_complete_ = true;
};

void PeersRun::enter(std::unique_ptr<Contender> contender, const PeerContender* peer) {
  Entrant entrant{.contender = std::move(contender), .peer = peer};
  for (const int low_callers : levels_) {
    entrant.findings.try_emplace(
        low_callers,
        Finding{Samples(settings_.round_count, static_cast<std::size_t>(count_per_round_)),
                Samples(settings_.round_count, 0)});
  }
  entrants_.push_back(std::move(entrant));
}

void PeersRun::start_peers(const PeerChoice& choice) {
  for (const PeerEntry* peer : choice.peers) {
    const auto program = find_program(*peer);
    if (!program) continue;
    for (const std::string& transport : transports_beside(peer->call_transports, config_.carrier)) {
      PeerSetting setting{.placement = config_.placement,
                          .realtime = config_.realtime,
                          .low_caller_count = config_.low_caller_count,
                          .work_ns = plan_.work.count()};
      setting.transport.set(transport);
      auto started = PeerContender::start(*peer, *program, "call", setting);
      if (!started) {
        say_not_measured(std::string(plan_.name) + ", peer " + std::string(peer->name),
                         started.error());
        is_complete_ = false;
        continue;
      }
      const PeerContender* const itself = started->get();
      enter(std::move(*started), itself);
    }
  }
}

void PeersRun::leave_out(const Entrant& entrant, const std::string& why) {
  say_not_measured(std::string(plan_.name) + ", peer " + entrant.peer->title(), why);
  is_complete_ = false;
}

expected<void, std::string> PeersRun::take_turn(Entrant& entrant, int low_callers,
                                                std::uint64_t count) {
  const TurnPlan plan{.warm_up_count = plan_.warm_up_count,
                      .count = count,
                      .period_ns = plan_.rate_hz > 0
                                       ? static_cast<std::int64_t>(1e9 / plan_.rate_hz)
                                       : std::int64_t{0},
                      .count_from = plan_.count_from,
                      .low_caller_count = low_callers};
  Finding& finding = entrant.findings.at(low_callers);
  const MonotonicTime begin = rt::now();
  auto taken = entrant.contender->take_turn(plan, finding.high, finding.low);
  const MonotonicTime end = rt::now();
  rt::sleep_until(end + std::chrono::duration_cast<Duration>((end - begin) * plan_.rest_part));
  return taken;
}

expected<void, std::string> PeersRun::measure_level(int low_callers, int round) {
  for (Entrant& entrant : entrants_) {
    entrant.findings.at(low_callers).high.begin_round(round);
    entrant.findings.at(low_callers).low.begin_round(round);
  }
  std::size_t first = 0;
  for (std::uint64_t done = 0; done < count_per_round_; done += plan_.turn_size, ++first) {
    const std::uint64_t count = std::min(plan_.turn_size, count_per_round_ - done);
    std::vector<std::size_t> failed;
    for (std::size_t i = 0; i < entrants_.size(); ++i) {
      // Who goes first changes from turn to turn.
      const std::size_t which = (i + first) % entrants_.size();
      Entrant& entrant = entrants_[which];
      if (auto taken = take_turn(entrant, low_callers, count); !taken) {
        if (entrant.peer == nullptr) return taken;
        leave_out(entrant, taken.error());
        failed.push_back(which);
      }
    }
    std::ranges::sort(failed, std::greater<>{});
    for (const std::size_t which : failed)
      entrants_.erase(entrants_.begin() + static_cast<std::ptrdiff_t>(which));
  }
  return {};
}

expected<void, std::string> PeersRun::measure(Duel& duel) {
  for (const Side side : kBothSides) {
    auto contender = connect_contender(duel, side, config_, plan_.work);
    if (!contender) return unexpected{contender.error()};
    enter(std::move(*contender), nullptr);
  }
  // They were entered behind the peers, whose programs had to start before any thread.
  std::rotate(entrants_.begin(), entrants_.end() - 2, entrants_.end());
  for (int round = 0; round < settings_.round_count; ++round) {
    for (const int low_callers : levels_) {
      if (auto measured = measure_level(low_callers, round); !measured) return measured;
    }
  }
  return {};
}

std::string PeersRun::title(int low_callers) const {
  std::string text = title_of(plan_.name, config_);
  if (plan_.rate_hz > 0) text += ", " + short_text(plan_.rate_hz) + " Hz";
  if (plan_.work != Duration{0}) {
    text +=
        ", " + std::to_string(low_callers) + " low-priority caller" + (low_callers == 1 ? "" : "s");
  }
  return text;
}

/// How far a contender's figures moved from its own idle ones, and what its load met.
void PeersRun::add_load(JsonObject& json, const Entrant& entrant, int low_callers,
                        const std::string& prefix) const {
  if (plan_.work == Duration{0}) return;
  const Finding& finding = entrant.findings.at(low_callers);
  const Samples& idle = entrant.findings.at(0).high;
  for (const auto& [key, percent] : {std::pair{"p50", 50.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    const Ratio growth = ratio_at(finding.high, idle, percent);
    const std::string field = prefix + "loaded_over_idle_" + key;
    json.add(field, growth.median);
    json.add(field + "_low", growth.low);
    json.add(field + "_high", growth.high);
  }
  if (finding.low.count() == 0) return;
  add_percentiles(json, prefix + "low_", finding.low.percentiles());
  json.add(prefix + "low_n", static_cast<std::int64_t>(finding.low.count()));
}

Result PeersRun::result_of_rtpm(int low_callers) const {
  Result result{.title = title(low_callers)};
  add_comparison(result, plan_.name, config_, rtpm(low_callers).high, floor(low_callers).high);
  if (plan_.rate_hz > 0) result.json.add("rate_hz", plan_.rate_hz);
  if (plan_.work != Duration{0}) result.json.add("low_callers", low_callers);
  add_load(result.json, entrants_[0], low_callers, "");
  add_load(result.json, entrants_[1], low_callers, "floor_");
  for (const Entrant& entrant : entrants_) {
    if (entrant.peer == nullptr) continue;
    const Finding& peer = entrant.findings.at(low_callers);
    result.rows.push_back({entrant.peer->title(), peer.high.percentiles()});
  }
  return result;
}

Result PeersRun::result_of_peer(const Entrant& entrant, int low_callers) const {
  const Finding& finding = entrant.findings.at(low_callers);
  Result result;
  JsonObject& json = result.json;
  json.add("case", plan_.name);
  json.add("peer", entrant.peer->name());
  json.add("transport", entrant.peer->transport());
  json.add("payload", static_cast<std::int64_t>(kPayloadSize));
  json.add("n", static_cast<std::int64_t>(finding.high.count()));
  json.add("rounds", finding.high.round_count());
  if (plan_.rate_hz > 0) json.add("rate_hz", plan_.rate_hz);
  if (plan_.work != Duration{0}) json.add("low_callers", low_callers);
  add_distribution(json, "", finding.high);
  json.add("rtpm_transport", to_string(config_.carrier));
  json.add("rtpm_wait", rt::to_string(config_.wait.strategy));
  add_distribution(json, "rtpm_", rtpm(low_callers).high);
  add_distribution(json, "floor_", floor(low_callers).high);
  add_peer_ratios(json, rtpm(low_callers).high, finding.high);
  add_load(json, entrant, low_callers, "");
  add_load(json, entrants_[0], low_callers, "rtpm_");
  return result;
}

void PeersRun::report(Report& report, const DisturbanceWatch& watch) const {
  for (const int low_callers : levels_) {
    Result result = result_of_rtpm(low_callers);
    watch.finish(result, longest_us(result));
    report.add(result);
    for (const Entrant& entrant : entrants_) {
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
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  PeersRun run(settings, config, plan);
  run.start_peers(choice);
  if (!run.has_peers()) return run.is_complete();
  auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    if (auto done = run.measure(**duel); !done) return done;
    run.report(report, watch);
    return {};
  });
  if (!measured) return unexpected{measured.error()};
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
