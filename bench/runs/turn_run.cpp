#include "runs/turn_run.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

TurnRun::TurnRun(const Settings& settings, const CasePlan& plan)
    : settings_(settings),
      plan_(plan),
      round_count_(settings.round_count),
      levels_(plan.low_caller_counts.begin(), plan.low_caller_counts.end()) {
  const std::uint64_t count =
      settings.sample_count == 0 ? plan.sample_count : settings.sample_count;
  // Where calls are paced, a round is a turn of each: where the machine stood still, little is
  // lost.
  if (plan.rate_hz > 0) {
    round_count_ = std::max(round_count_, static_cast<int>(count / plan.turn_size));
  }
  count_per_round_ = std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(round_count_));
  for (int i = 0; i < kOwnCount; ++i)
    enter({});
}

std::vector<Rounds> TurnRun::parts() const {
  return parts_of_run(round_count_, plan_.part_count);
}

TurnRun::Entrant& TurnRun::enter(const std::string& title) {
  Entrant& entrant = entrants_.emplace_back(Entrant{.title = title});
  for (const int low_callers : levels_) {
    entrant.findings.try_emplace(
        low_callers, Finding{Samples(round_count_, static_cast<std::size_t>(count_per_round_)),
                             Samples(round_count_, 0)});
  }
  return entrant;
}

bool TurnRun::has_peers() const noexcept {
  return std::ranges::any_of(entrants_, [](const Entrant& each) { return each.peer != nullptr; });
}

void TurnRun::start_peers(const PeerChoice& choice, std::string_view verb, Carrier carrier,
                          const PeerSetting& setting) {
  for (const PeerEntry* peer : choice.peers) {
    const auto program = find_program(*peer);
    if (!program) continue;
    const auto transports = verb == "call" ? peer->call_transports : peer->event_transports;
    for (const std::string& transport : transports_beside(transports, carrier)) {
      PeerSetting its_setting = setting;
      its_setting.transport.set(transport);
      start_peer(*peer, *program, verb, its_setting);
    }
  }
  // Who did not start in a later part has not all rounds.
  entrants_.erase(std::remove_if(entrants_.begin() + kOwnCount, entrants_.end(),
                                 [](const Entrant& each) { return each.contender == nullptr; }),
                  entrants_.end());
  has_begun_ = true;
}

void TurnRun::start_peer(const PeerEntry& peer, const std::string& program, std::string_view verb,
                         const PeerSetting& setting) {
  const std::string title = peer_title(peer.name, setting.transport.get());
  const auto known = std::ranges::find(entrants_, title, &Entrant::title);
  if (has_begun_ && known == entrants_.end()) return;
  auto started = PeerContender::start(peer, program, std::string(verb), setting);
  if (!started) {
    say_not_measured(std::string(plan_.name) + ", peer " + std::string(peer.name), started.error());
    is_complete_ = false;
    return;
  }
  Entrant& entrant = known == entrants_.end() ? enter(title) : *known;
  entrant.peer = started->get();
  entrant.contender = std::move(*started);
}

expected<void, std::string> TurnRun::take_turn(Entrant& entrant, int low_callers,
                                               std::uint64_t count) {
  const TurnPlan plan{.warm_up_count = plan_.warm_up_count,
                      .count = count,
                      .period_ns = plan_.rate_hz > 0
                                       ? static_cast<std::int64_t>(1e9 / plan_.rate_hz)
                                       : std::int64_t{0},
                      .count_from = plan_.count_from,
                      .low_caller_count = low_callers};
  Finding& finding = entrant.findings.at(low_callers);
  const RoundWatch round_watch(&*detector_);
  const MonotonicTime begin = rt::now();
  auto taken = entrant.contender->take_turn(plan, finding.high, finding.low);
  const MonotonicTime end = rt::now();
  const bool was_disturbed = round_watch.was_disturbed();
  finding.high.note_disturbed(was_disturbed);
  finding.low.note_disturbed(was_disturbed);
  rt::sleep_until(end + std::chrono::duration_cast<Duration>((end - begin) * plan_.rest_part));
  return taken;
}

expected<void, std::string> TurnRun::measure_level(int low_callers, int round) {
  for (Entrant& entrant : entrants_) {
    entrant.findings.at(low_callers).high.begin_round(round);
    entrant.findings.at(low_callers).low.begin_round(round);
  }
  auto first = static_cast<std::size_t>(round);
  for (std::uint64_t done = 0; done < count_per_round_; done += plan_.turn_size, ++first) {
    const std::uint64_t count = std::min(plan_.turn_size, count_per_round_ - done);
    std::vector<std::size_t> failed;
    for (std::size_t i = 0; i < entrants_.size(); ++i) {
      // Who goes first changes from turn to turn, and so does who goes before whom.
      const std::size_t place = first % 2 == 0 ? i : entrants_.size() - 1 - i;
      const std::size_t which = (place + first / 2) % entrants_.size();
      Entrant& entrant = entrants_[which];
      if (auto taken = take_turn(entrant, low_callers, count); !taken) {
        if (entrant.peer == nullptr) return taken;
        say_not_measured(std::string(plan_.name) + ", peer " + entrant.title, taken.error());
        is_complete_ = false;
        failed.push_back(which);
      }
    }
    std::ranges::sort(failed, std::greater<>{});
    for (const std::size_t which : failed)
      entrants_.erase(entrants_.begin() + static_cast<std::ptrdiff_t>(which));
  }
  return {};
}

expected<void, std::string> TurnRun::measure(std::unique_ptr<Contender> rtpm,
                                             std::unique_ptr<Contender> floor,
                                             const Placement& placement, Rounds rounds) {
  entrants_[0].contender = std::move(rtpm);
  entrants_[1].contender = std::move(floor);
  const std::vector<int> cpus = cpus_of(placement);
  detector_.emplace();
  // Calls that follow one another would meet its threads too often, and miss less of a stall.
  if (plan_.rate_hz > 0) {
    if (auto started = detector_->start(cpus); !started) return started;
  }
  for (int round = rounds.begin; round < rounds.end; ++round) {
    for (const int low_callers : levels_) {
      if (auto measured = measure_level(low_callers, round); !measured) return measured;
    }
  }
  return {};
}

void TurnRun::end_part() {
  detector_.reset();
  for (Entrant& entrant : entrants_) {
    entrant.contender.reset();
    entrant.peer = nullptr;
  }
}

}  // namespace rtpm::bench
