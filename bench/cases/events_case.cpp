#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "runs/event_run.hpp"
#include "sides/event_sides.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kEventCountDefault = 2'000;
constexpr int kPartCount = 5;             ///< Starts of the servers in a run.
constexpr std::size_t kWarmUpCount = 20;  ///< Events after each start.
/// Of the isolation result: so many consumers, of which so many are stopped and so many slow.
constexpr int kCrowd = 64;
constexpr int kStopped = 8;
constexpr int kSlow = 8;

Duration period_of(const Settings& settings) {
  return Duration{static_cast<std::int64_t>(1e9 / settings.rate_hz)};
}

void add_head(Result& result, const EventSetting& setting, const Settings& settings,
              std::size_t count) {
  JsonObject& json = result.json;
  json.add("case", "events");
  json.add("transport", to_string(setting.carrier));
  if (setting.is_multicast) json.add("delivery", kMulticast);
  json.add("wait", rt::to_string(setting.wait.strategy));
  json.add("payload", static_cast<std::int64_t>(sizeof(EventStamp)));
  json.add("n", static_cast<std::int64_t>(count));
  json.add("rate_hz", settings.rate_hz);
  json.add("consumers", setting.consumer_count);
  json.add("own_threads", setting.has_own_threads);
}

std::size_t count_per_round(const Settings& settings) {
  const std::uint64_t count =
      settings.sample_count == 0 ? kEventCountDefault : settings.sample_count;
  return static_cast<std::size_t>(
      std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count)));
}

/// The distribution as bars, one for each fifth of a power of two, for people; for programs the
/// number of latencies in each, "80us": 12 being those from 80 µs on.
void add_plot(Result& result, std::string_view who, std::string_view prefix,
              const std::vector<Duration>& latencies) {
  constexpr double kStepsPerOctave = 5;
  constexpr std::size_t kBarMax = 60;
  std::map<int, std::size_t> bins;
  for (const Duration latency : latencies) {
    const double us = std::max(1.0, static_cast<double>(latency.count()) / 1000);
    ++bins[static_cast<int>(std::floor(std::log2(us) * kStepsPerOctave))];
  }
  std::size_t largest = 1;
  for (const auto& [bin, count] : bins)
    largest = std::max(largest, count);
  JsonObject counts;
  result.notes.push_back(std::string(who) + ", latencies from … on:");
  for (const auto& [bin, count] : bins) {
    const std::string from = short_text(std::exp2(bin / kStepsPerOctave)) + " us";
    const std::size_t bar = (count * kBarMax + largest - 1) / largest;
    result.notes.push_back(std::string(10 - std::min<std::size_t>(9, from.size()), ' ') + from +
                           "  " + std::string(bar, '#') + " " + std::to_string(count));
    counts.add(from, static_cast<std::int64_t>(count));
  }
  result.json.add(std::string(prefix) + "counts", counts);
}

/// What hub and relay showed with so many consumers.
struct FanOut {
  FanOut(int round_count, std::size_t per_round, int consumer_count)
      : findings{EventFinding(round_count, per_round, consumer_count),
                 EventFinding(round_count, per_round, consumer_count)},
        board(static_cast<std::size_t>(consumer_count), kEventBlockSize) {}

  std::array<EventFinding, 2> findings;
  EventBoard board;
  std::uint32_t block = 0;
  std::uint64_t lost_count = 0;
  DisturbanceWatch watch{{}};
};

/// Some rounds of both, by turns.
expected<void, std::string> measure_rounds(const Settings& settings, const EventSetting& setting,
                                           const std::array<EventSide*, 2>& sides, Rounds rounds,
                                           FanOut& fan_out) {
  const std::size_t per_round = count_per_round(settings);
  const auto measure = [&](std::size_t which, std::size_t count, EventFinding& finding) {
    return measure_events(period_of(settings), count, *sides[which], fan_out.board, ++fan_out.block,
                          setting.consumer_count, finding);
  };
  for (std::size_t which = 0; which < 2; ++which) {
    EventFinding cold(1, kWarmUpCount, setting.consumer_count);
    if (auto pushed = measure(which, kWarmUpCount, cold); !pushed) return pushed;
  }
  for (int round = rounds.begin; round < rounds.end; ++round) {
    for (EventFinding& finding : fan_out.findings)
      finding.begin_round(round);
    const RoundWatch round_watch;
    for (std::size_t done = 0; done < per_round; done += kEventBlockSize) {
      const std::size_t count = std::min(kEventBlockSize, per_round - done);
      for (std::size_t turn = 0; turn < 2; ++turn) {
        const std::size_t which = (turn + fan_out.block / 2) % 2;
        auto pushed = measure(which, count, fan_out.findings[which]);
        if (!pushed) return pushed;
      }
    }
    const bool was_disturbed = round_watch.was_disturbed();
    for (EventFinding& finding : fan_out.findings)
      finding.note_disturbed(was_disturbed);
  }
  return {};
}

/// The same with a hub and a relay that are started for it.
expected<void, std::string> measure_part(const Settings& settings, const EventSetting& setting,
                                         Rounds rounds, FanOut& fan_out) {
  auto hub = start_event_hub(setting);
  if (!hub) return unexpected{hub.error()};
  auto relay = start_event_relay(setting);
  if (!relay) return unexpected{relay.error()};
  const DuelConfig caller{.placement = setting.placement, .realtime = setting.realtime};
  fan_out.watch.follow({hub->id(), relay->id()});
  auto measured = run_as_caller(caller, [&]() -> expected<void, std::string> {
    if (setting.network != nullptr) {
      if (auto entered = setting.network->enter(NetworkPair::Host::kClient); !entered) {
        return entered;
      }
    }
    auto rtpm = connect_events(setting, hub->address(), fan_out.board);
    if (!rtpm) return unexpected{rtpm.error()};
    auto floor = connect_relay(setting, relay->address(), fan_out.board);
    if (!floor) return unexpected{floor.error()};
    auto done = measure_rounds(settings, setting, {rtpm->get(), floor->get()}, rounds, fan_out);
    fan_out.lost_count += (*rtpm)->lost_count();
    return done;
  });
  fan_out.watch.note();
  return measured;
}

/// Hub and relay by turns, with so many consumers.
expected<void, std::string> measure_fan_out(const Settings& settings, const EventSetting& setting,
                                            Result& result) {
  FanOut fan_out(settings.round_count, count_per_round(settings), setting.consumer_count);
  for (const Rounds rounds : parts_of_run(settings.round_count, kPartCount)) {
    auto measured = measure_part(settings, setting, rounds, fan_out);
    if (!measured) return measured;
  }
  const auto& [rtpm, floor] = fan_out.findings;
  add_fan_out(result, settings, setting, {rtpm.each, rtpm.last, rtpm.missing_count},
              {floor.each, floor.last, floor.missing_count});
  if (settings.tells_latencies) add_latencies(result, rtpm.each, floor.each);
  result.json.add("lost", static_cast<std::int64_t>(fan_out.lost_count));
  if (setting.network != nullptr) {
    result.json.add("hosts", 2);
    add_plot(result, "RTPM", "plot_", rtpm.all);
    add_plot(result, "raw floor", "floor_plot_", floor.all);
  }
  fan_out.watch.finish(result, rtpm.last.percentiles().max);
  return {};
}

/// The others' latencies while all are well, and while some are stopped and some slow, by turns.
expected<void, std::string> measure_isolation(const Settings& settings, const EventSetting& wanted,
                                              Result& result) {
  EventSetting setting = wanted;
  setting.consumer_count = kCrowd - kStopped;
  const int measured_count = setting.consumer_count - kSlow;
  auto hub = start_event_hub(setting);
  if (!hub) return unexpected{hub.error()};
  auto idle = start_idle_consumers(setting, hub->address(), kStopped);
  if (!idle) return unexpected{idle.error()};
  const std::size_t per_round = count_per_round(settings);
  std::array<EventFinding, 2> findings{
      EventFinding(settings.round_count, per_round, measured_count),
      EventFinding(settings.round_count, per_round, measured_count)};
  EventBoard board(static_cast<std::size_t>(setting.consumer_count), kEventBlockSize);
  const DuelConfig caller{.placement = setting.placement, .realtime = setting.realtime};
  auto measured = run_as_caller(caller, [&]() -> expected<void, std::string> {
    auto side = connect_events(setting, hub->address(), board);
    if (!side) return unexpected{side.error()};
    std::uint32_t block = 0;
    for (int round = 0; round < settings.round_count; ++round) {
      for (EventFinding& finding : findings)
        finding.begin_round(round);
      const RoundWatch round_watch;
      for (std::size_t done = 0; done < per_round; done += kEventBlockSize) {
        const std::size_t count = std::min(kEventBlockSize, per_round - done);
        for (const bool is_bad : {false, true}) {
          (*side)->set_slow(is_bad ? kSlow : 0);
          if (is_bad) idle->pause();
          auto pushed = measure_events(period_of(settings), count, **side, board, ++block,
                                       measured_count, findings[is_bad ? 1 : 0]);
          if (is_bad) idle->resume();
          if (!pushed) return pushed;
        }
      }
      const bool was_disturbed = round_watch.was_disturbed();
      for (EventFinding& finding : findings)
        finding.note_disturbed(was_disturbed);
    }
    return {};
  });
  if (!measured) return measured;
  const auto& [well, bad] = findings;
  setting.consumer_count = kCrowd;
  add_head(result, setting, settings, bad.last.count());
  result.json.add("stopped", kStopped);
  result.json.add("slow", kSlow);
  add_distribution(result.json, "each_", bad.each);
  add_distribution(result.json, "last_", bad.last);
  add_distribution(result.json, "well_each_", well.each);
  add_distribution(result.json, "well_last_", well.last);
  add_ratios(result.json, "bad_over_well_", bad.each, well.each);
  add_rounds(result, bad.last, well.last);
  result.rows = {{"others, all well", well.each.percentiles()},
                 {"others, some bad", bad.each.percentiles()}};
  result.title = title_of(setting) + ", 8 stopped and 8 slow";
  return {};
}

expected<void, std::string> measure_rate(const Settings&, const EventSetting& setting,
                                         Result& result) {
  auto hub = start_event_hub(setting);
  if (!hub) return unexpected{hub.error()};
  const auto measured = measure_event_rate(setting, hub->address());
  if (!measured) return unexpected{measured.error()};
  result.title = "events, " + std::string(to_string(setting.carrier)) + ", as many as go through";
  result.json.add("case", "events");
  result.json.add("transport", to_string(setting.carrier));
  result.json.add("payload", static_cast<std::int64_t>(sizeof(EventStamp)));
  result.json.add("consumers", 1);
  result.json.add("events_per_s", measured->events_per_s);
  result.json.add("missing", static_cast<std::int64_t>(measured->missing_count));
  result.json.add("lost", static_cast<std::int64_t>(measured->lost_count));
  result.notes.push_back(short_text(measured->events_per_s / 1e6) +
                         " million events a second reached one consumer, who missed " +
                         std::to_string(measured->missing_count) + " of 300000.");
  return {};
}

using Measure = expected<void, std::string> (*)(const Settings&, const EventSetting&, Result&);

bool report_one(const Settings& settings, const EventSetting& setting, Measure measure,
                Report& report) {
  Result result{.title = title_of(setting)};
  if (auto measured = measure(settings, setting, result); !measured) {
    say_not_measured(title_of(setting), measured.error());
    return false;
  }
  report.add(result);
  return true;
}

bool is_asked_for(const Settings& settings, int consumer_count) {
  return std::ranges::find(settings.consumer_counts, consumer_count) !=
         settings.consumer_counts.end();
}

/// As the paper's Figure 7 b and c: supplier and consumer on one host, the hub on the other.
bool report_two_hosts(const Settings& settings, EventSetting setting, Report& report) {
  // Memory is of one host.
  if (setting.carrier == Carrier::kSharedMemory) return true;
  const auto network = NetworkPair::create();
  if (!network) {
    say_not_measured(title_of(setting) + ", two hosts", network.error());
    return false;
  }
  setting.network = &*network;
  setting.consumer_count = 1;
  return report_one(settings, setting, measure_fan_out, report);
}

}  // namespace

bool run_events(const Settings& settings, Report& report) {
  if (!settings.peers.empty()) return run_events_with_peers(settings, report);
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      EventSetting setting{.carrier = carrier,
                           .wait = {.strategy = strategy, .spin = settings.spin},
                           .is_multicast = settings.has_multicast,
                           .placement = choose_placement(),
                           .realtime = settings.realtime,
                           .has_own_threads = settings.has_own_threads};
      // The network between the two hosts has no group.
      if (!setting.is_multicast) {
        is_complete = report_two_hosts(settings, setting, report) && is_complete;
      }
      for (const int count : settings.consumer_counts) {
        setting.consumer_count = count;
        is_complete = report_one(settings, setting, measure_fan_out, report) && is_complete;
      }
      if (is_asked_for(settings, kCrowd)) {
        setting.consumer_count = kCrowd;
        is_complete = report_one(settings, setting, measure_isolation, report) && is_complete;
      }
      // Every latency is asked for, which a rate has not.
      if (settings.tells_latencies) continue;
      setting.consumer_count = 1;
      is_complete = report_one(settings, setting, measure_rate, report) && is_complete;
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
