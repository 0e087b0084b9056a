#include "runs/run.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::bench {
namespace {

/// If the idle server is measured only for comparison, one round in this many is enough.
constexpr int kRoundsPerIdleRound = 4;

std::string title_of_peer(const std::string& name, const std::string& transport) {
  return "peer " + name + ", " + transport;
}

}  // namespace

Outcome<> run_as_caller(const Settings& settings, const std::function<Outcome<>()>& body) {
  Outcome<> measured;
  auto thread = rt::Thread::start({.name = "bench-caller",
                                   .priority = kHighPriority,
                                   .cpus = {choose_placement().client_cpu},
                                   .realtime = settings.realtime},
                                  [&] { measured = body(); });
  if (!thread) return failure(thread.error());
  thread->join();
  return measured;
}

Run::Run(const Settings& settings, RunPlan plan, Report& report)
    : settings_(settings), plan_(std::move(plan)), report_(report) {
  const std::uint64_t count =
      settings.sample_count == 0 ? plan_.sample_count : settings.sample_count;
  round_count_ = plan_.is_round_a_turn
                     ? static_cast<int>(std::max<std::uint64_t>(1, count / plan_.turn_size))
                     : settings.round_count;
  count_per_round_ = std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(round_count_));
}

void Run::invite(std::vector<const PeerEntry*> peers, std::string verb, Carrier carrier,
                 const PeerSetting& setting) {
  peers_ = std::move(peers);
  peer_verb_ = std::move(verb);
  peer_carrier_ = carrier;
  peer_setting_ = setting;
}

bool Run::is_asked(int load) const {
  return std::ranges::find(plan_.loads, load) != plan_.loads.end();
}

Run::Entrant& Run::enter(const std::string& peer, const std::string& transport) {
  Entrant& entrant = entrants_.emplace_back(Entrant{.peer = peer, .transport = transport});
  const auto room = static_cast<std::size_t>(count_per_round_);
  const auto make_finding = [&] {
    return Finding{Samples(round_count_, room), Samples(round_count_, 0)};
  };
  for (const int load : plan_.loads)
    entrant.findings.try_emplace(load, make_finding());
  // The idle figures, which every load is compared with, unless peers would take that time, too.
  if (!plan_.load_field.empty() && peers_.empty()) entrant.findings.try_emplace(0, make_finding());
  return entrant;
}

void Run::start_peers(bool is_first_part) {
  for (const PeerEntry* peer : peers_) {
    const auto program = find_program(*peer);
    if (!program) continue;
    const std::string name(peer->name);
    for (const std::string& transport : peer->transports(peer_verb_, peer_carrier_)) {
      const auto known = std::ranges::find_if(entrants_, [&](const Entrant& each) {
        return each.peer == name && each.transport == transport;
      });
      // An entrant that failed in an earlier part lacks rounds.
      if (!is_first_part && known == entrants_.end()) continue;
      peer_setting_.transport = transport;
      auto contender = start_peer(*program, peer_verb_, peer_setting_);
      if (contender) {
        (is_first_part ? enter(name, transport) : *known).contender = std::move(*contender);
      } else {
        report_.fail(title_of_peer(name, transport), contender.error());
      }
    }
  }
  std::erase_if(entrants_,
                [](const Entrant& each) { return !each.peer.empty() && !each.contender; });
}

Outcome<> Run::measure(const Start& start) {
  for ([[maybe_unused]] const Side side : kBothSides)
    enter({}, {});
  const int part_count = std::min(plan_.part_count, round_count_);
  for (int part = 0; part < part_count; ++part) {
    const auto connect = start();
    if (!connect) return failure(connect.error());
    start_peers(part == 0);
    if (!peers_.empty() && entrants_.size() == std::size(kBothSides)) return {};
    has_begun_ = true;
    auto measured = run_as_caller(settings_, [&] {
      return measure_part(*connect, round_count_ * part / part_count,
                          round_count_ * (part + 1) / part_count);
    });
    detector_.reset();
    for (Entrant& entrant : entrants_)
      entrant.contender = nullptr;
    if (!measured) return measured;
  }
  return {};
}

Outcome<> Run::measure_part(const Connect& connect, int begin, int end) {
  auto contenders = connect();
  if (!contenders) return failure(contenders.error());
  for (std::size_t i = 0; i < contenders->size(); ++i)
    entrants_[i].contender = std::move((*contenders)[i]);
  detector_.emplace();
  // Calls one after the other would meet its threads too often, and miss less of a stall.
  if (plan_.rate_hz > 0) {
    if (auto started = detector_->start(cpus_of(choose_placement())); !started) return started;
  }
  for (int round = begin; round < end; ++round) {
    for (const auto& [load, finding] : entrants_[0].findings) {
      if (!is_asked(load) && round % kRoundsPerIdleRound != 0) continue;
      if (auto measured = measure_round(load, round); !measured) return measured;
    }
  }
  return {};
}

Outcome<> Run::measure_round(int load, int round) {
  for (Entrant& entrant : entrants_) {
    Finding& finding = entrant.findings.at(load);
    finding.first.begin_round(round);
    finding.second.begin_round(round);
  }
  auto first = static_cast<std::size_t>(round);
  for (std::uint64_t done = 0; done < count_per_round_; done += plan_.turn_size, ++first) {
    const std::uint64_t count = std::min(plan_.turn_size, count_per_round_ - done);
    for (std::size_t i = 0; i < entrants_.size(); ++i) {
      // The first contender changes from turn to turn, and so does the order of the others.
      const std::size_t place = first % 2 == 0 ? i : entrants_.size() - 1 - i;
      Entrant& entrant = entrants_[(place + first / 2) % entrants_.size()];
      if (!entrant.contender) continue;
      if (auto taken = take_turn(entrant, load, count); !taken) {
        if (entrant.peer.empty()) return taken;
        report_.fail(title_of_peer(entrant.peer, entrant.transport), taken.error());
        entrant.contender = nullptr;
      }
    }
  }
  std::erase_if(entrants_, [](const Entrant& each) { return !each.contender; });
  return {};
}

Outcome<> Run::take_turn(Entrant& entrant, int load, std::uint64_t count) {
  const TurnPlan plan{.warm_up_count = plan_.warm_up_count,
                      .count = count,
                      .period_ns = plan_.rate_hz > 0
                                       ? static_cast<std::int64_t>(1e9 / plan_.rate_hz)
                                       : std::int64_t{0},
                      .count_from = plan_.count_from,
                      .low_caller_count = load};
  Finding& finding = entrant.findings.at(load);
  const RoundWatch round_watch(*detector_);
  const MonotonicTime begin = rt::now();
  auto taken = entrant.contender(plan, finding);
  const MonotonicTime end = rt::now();
  const bool was_disturbed = round_watch.was_disturbed();
  finding.first.note_disturbed(was_disturbed);
  finding.second.note_disturbed(was_disturbed);
  rt::sleep_until(end + std::chrono::duration_cast<Duration>((end - begin) * plan_.rest_part));
  return taken;
}

void Run::report(const Json& head, const Json& tail) {
  if (!has_begun_) return;
  for (const auto& [load, finding] : entrants_[0].findings) {
    if (!is_asked(load)) continue;
    Json own = result(head, load);
    own.update(tail);
    report_.add(std::move(own));
    for (std::size_t peer = std::size(kBothSides); peer < entrants_.size(); ++peer)
      report_.add(result_of_peer(head, entrants_[peer], load));
  }
}

double Run::paced_seconds() const {
  return static_cast<double>(count_per_round_) * round_count_ / plan_.rate_hz;
}

Json Run::result(const Json& head, int load) const {
  Json result = head;
  const Entrant& floor = entrants_[1];
  const Finding& finding = entrants_[0].findings.at(load);
  if (!plan_.load_field.empty()) result[plan_.load_field] = load;
  add_pair(result, "", finding, "floor_", floor.findings.at(load), "ratio_");
  add_load(result, "", entrants_[0], load);
  add_load(result, "floor_", floor, load);
  if (settings_.tells_latencies) {
    result["latencies_us"] = finding.first.all_us();
    result["floor_latencies_us"] = floor.findings.at(load).first.all_us();
  }
  add_steal(result, cpu_time_);
  return result;
}

Json Run::result_of_peer(const Json& head, const Entrant& peer, int load) const {
  Json result = head;
  result["rtpm_transport"] = head["transport"];
  result["rtpm_wait"] = head["wait"];
  result.erase("wait");
  result["peer"] = peer.peer;
  result["transport"] = peer.transport;
  if (!plan_.load_field.empty()) result[plan_.load_field] = load;
  add_pair(result, "rtpm_", entrants_[0].findings.at(load), "", peer.findings.at(load),
           "rtpm_over_peer_");
  add_load(result, "", peer, load);
  add_steal(result, cpu_time_);
  return result;
}

void Run::add_pair(Json& result, const std::string& over_name, const Finding& over,
                   const std::string& under_name, const Finding& under,
                   const std::string& ratio_name) const {
  const bool is_each_told = plan_.names.size() > 1;
  result["n"] = is_each_told ? over.second.count() : over.first.count();
  if (plan_.rate_hz > 0) result["rate_hz"] = plan_.rate_hz;
  for (std::size_t i = 0; i < plan_.names.size(); ++i) {
    const Samples& above = i == 0 ? over.first : over.second;
    const Samples& below = i == 0 ? under.first : under.second;
    add_distribution(result, over_name + plan_.names[i], above);
    add_distribution(result, under_name + plan_.names[i], below);
    add_ratios(result, ratio_name + plan_.names[i], above, below);
  }
  add_rounds(result, over.first, under.first);
  if (!is_each_told) return;
  result[over_name + "missing"] = over.missing_count;
  result[under_name + "missing"] = under.missing_count;
}

/// Adds the figures' shift from the idle ones, where these were measured, and the load's latencies.
void Run::add_load(Json& result, const std::string& prefix, const Entrant& entrant,
                   int load) const {
  if (plan_.load_field.empty() || load == 0) return;
  const Finding& finding = entrant.findings.at(load);
  if (const auto idle = entrant.findings.find(0); idle != entrant.findings.end()) {
    add_distribution(result, prefix + "idle_", idle->second.first);
    add_ratios(result, prefix + "loaded_over_idle_", finding.first, idle->second.first);
  }
  if (finding.second.count() == 0) return;
  add_distribution(result, prefix + "low_", finding.second);
  result[prefix + "low_n"] = finding.second.count();
}

}  // namespace rtpm::bench
