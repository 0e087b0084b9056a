#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "cases/case.hpp"
#include "rtpm/rt/clock.hpp"
#include "sides/event_sides.hpp"

namespace rtpm::bench {
namespace {

/// The consumers of the isolation result, and how many of them are stopped and slow.
constexpr int kCrowd = 64;
constexpr int kStopped = 8;
constexpr int kSlow = 8;
constexpr int kOthers = kCrowd - kStopped - kSlow;  ///< The first ones, which are measured.

RunPlan plan_of(const Settings& settings) {
  return {.sample_count = 2'000,
          .turn_size = kEventBlockSize,
          .part_count = settings.peers.empty() ? 5 : 1,
          .rate_hz = settings.rate_hz,
          .names = {"each_", "last_"}};
}

Json head_of(const EventSetting& setting) {
  Json head{{"case", "events"}, {"transport", to_string(setting.carrier)}};
  if (setting.has_own_hub) head["hub"] = "supplier's";
  if (setting.is_multicast) head["delivery"] = "multicast";
  head["wait"] = rt::to_string(setting.wait.strategy);
  head["payload"] = sizeof(EventStamp);
  head["consumers"] = setting.consumer_count;
  if (setting.network != nullptr) head["hosts"] = 2;
  return head;
}

/// A supplier and consumers, and where these note what they got.
struct EventLine {
  explicit EventLine(int consumer_count)
      : board(static_cast<std::size_t>(consumer_count), kEventBlockSize) {}

  /// Events of which the first consumers count.
  Outcome<> take_turn(const TurnPlan& plan, int count, Finding& finding) {
    constexpr Duration kPatience = std::chrono::seconds{5};
    constexpr std::uint64_t kWarmUpCount = 20;
    // The first events come when all are connected.
    for (const MonotonicTime give_up = rt::now() + kPatience; !is_warm;) {
      if (rt::now() > give_up) return failure("no event arrives");
      Finding cold{Samples(1, 0), Samples(1, 0)};
      const TurnPlan few{.count = kWarmUpCount, .period_ns = plan.period_ns};
      auto pushed = push_events(few, *side, board, ++block, count, cold);
      if (!pushed) return pushed;
      is_warm = cold.first.count() > 0;
    }
    return push_events(plan, *side, board, ++block, count, finding);
  }

  EventBoard board;
  std::unique_ptr<EventSide> side{};  ///< Notes to the board, so it ends first.
  std::uint32_t block = 0;
  bool is_warm = false;  ///< An event went the whole way.
};

Outcome<std::shared_ptr<EventLine>> connect_line(decltype(&connect_events) connect_side,
                                                 const EventSetting& setting,
                                                 const std::string& address, int count) {
  auto line = std::make_shared<EventLine>(count);
  auto side = connect_side(setting, address, line->board);
  if (!side) return failure(side.error());
  line->side = std::move(*side);
  return line;
}

/// The middle between supplier and consumers: processes of their own or, started on the caller's
/// thread, a hub in this program and no relay.
struct Middle {
  std::vector<ServerProcess> processes{};  ///< The hub and the relay.
  std::optional<EventHub> own_hub{};
};

Outcome<Contenders> connect(const EventSetting& setting, Middle& middle) {
  if (setting.network != nullptr) {
    if (auto entered = setting.network->enter(NetworkPair::Host::kClient); !entered) {
      return failure(entered.error());
    }
  }
  std::array<std::string, 2> addresses;
  if (setting.has_own_hub) {
    auto hub = open_event_hub(setting);
    if (!hub) return failure(hub.error());
    middle.own_hub.emplace(std::move(*hub));
    addresses[0] = middle.own_hub->url();
  } else {
    std::ranges::transform(middle.processes, addresses.begin(), &ServerProcess::address);
  }
  Contenders contenders;
  for (const auto& [connect_side, address] :
       {std::pair{&connect_events, addresses[0]}, std::pair{&connect_relay, addresses[1]}}) {
    auto line = connect_line(connect_side, setting, address, setting.consumer_count);
    if (!line) return failure(line.error());
    contenders.emplace_back(
        [line = *line, count = setting.consumer_count](const TurnPlan& plan, Finding& finding) {
          return line->take_turn(plan, count, finding);
        });
  }
  return contenders;
}

/// Hub and relay by turns, and peers.
Outcome<> measure_fan_out(const Settings& settings, const EventSetting& setting, Report& report) {
  Run run(settings, plan_of(settings), report);
  if (!settings.peers.empty()) {
    std::vector<const PeerEntry*> peers = chosen_peers(settings);
    if (setting.has_own_hub)
      std::erase_if(peers, [](const auto* peer) { return peer->has_broker; });
    run.invite(peers, "events", setting.carrier,
               {.placement = setting.placement,
                .realtime = setting.realtime,
                .consumer_count = setting.consumer_count});
  }
  auto measured = run.measure([&]() -> Outcome<Connect> {
    auto middle = std::make_shared<Middle>();
    if (!setting.has_own_hub) {
      for (const auto& start : {start_event_hub, start_event_relay}) {
        auto process = start(setting);
        if (!process) return failure(process.error());
        middle->processes.push_back(std::move(*process));
      }
    }
    return Connect([&, middle] { return connect(setting, *middle); });
  });
  if (measured) run.report(head_of(setting));
  return measured;
}

/// Measures the other consumers while some are stopped and some slow, or while all are well.
/// @param stopped  null: all are well
Contender crowd_contender(std::shared_ptr<EventLine> line, const ServerProcess* stopped) {
  return [line = std::move(line), stopped](const TurnPlan& plan, Finding& finding) {
    line->side->set_slow(stopped != nullptr ? kSlow : 0);
    if (stopped != nullptr) stopped->pause();
    auto taken = line->take_turn(plan, kOthers, finding);
    if (stopped != nullptr) stopped->resume();
    return taken;
  };
}

Outcome<> measure_crowd(const Settings& settings, EventSetting setting, Report& report) {
  setting.consumer_count = kCrowd - kStopped;
  RunPlan plan = plan_of(settings);
  plan.part_count = 1;
  Run run(settings, plan, report);
  auto measured = run.measure([&]() -> Outcome<Connect> {
    auto hub = start_event_hub(setting);
    if (!hub) return failure(hub.error());
    auto idle = start_idle_consumers(setting, hub->address(), kStopped);
    if (!idle) return failure(idle.error());
    const auto both = std::make_shared<std::array<ServerProcess, 2>>(
        std::array{std::move(*hub), std::move(*idle)});
    return Connect([&, both]() -> Outcome<Contenders> {
      auto line = connect_line(connect_events, setting, (*both)[0].address(), kOthers);
      if (!line) return failure(line.error());
      return Contenders{crowd_contender(*line, &(*both)[1]), crowd_contender(*line, nullptr)};
    });
  });
  if (!measured) return measured;
  setting.consumer_count = kCrowd;
  Json head = head_of(setting);
  head["stopped"] = kStopped;
  head["slow"] = kSlow;
  const Json found = run.result(head);
  Json result = Json::object();
  // In a Run, the same hub with only healthy consumers counts as the floor.
  for (const auto& [key, value] : found.items()) {
    std::string name = key;
    if (key.starts_with("floor_")) name = "well_" + key.substr(6);
    if (key.starts_with("ratio_each_")) name = "bad_over_well_" + key.substr(11);
    if (!key.starts_with("ratio_last_")) result[name] = value;
  }
  report.add(std::move(result));
  return {};
}

Outcome<> measure_rate(const EventSetting& setting, Report& report) {
  const auto hub = start_event_hub(setting);
  if (!hub) return failure(hub.error());
  const auto measured = measure_event_rate(setting, hub->address());
  if (!measured) return failure(measured.error());
  report.add({{"case", "events"},
              {"transport", to_string(setting.carrier)},
              {"payload", sizeof(EventStamp)},
              {"consumers", 1},
              {"events_per_s", rounded(measured->events_per_s)},
              {"missing", measured->missing_count},
              {"lost", measured->lost_count}});
  return {};
}

/// Like the paper's Figure 7 b and c: supplier and consumer on one host, the hub on the other.
Outcome<> measure_two_hosts(const Settings& settings, EventSetting setting, Report& report) {
  const auto network = NetworkPair::create();
  if (!network) return failure(network.error());
  setting.network = &*network;
  setting.consumer_count = 1;
  return measure_fan_out(settings, setting, report);
}

}  // namespace

/// Measures all that it can, whatever else fails.
Outcome<> measure_events(const Settings& settings, const DuelConfig& config, Report& report) {
  EventSetting setting{.carrier = config.carrier,
                       .wait = config.wait,
                       .has_own_hub = settings.has_own_hub,
                       .is_multicast = settings.has_multicast,
                       .placement = config.placement,
                       .realtime = config.realtime};
  const auto check = [&](const std::string& what, const Outcome<>& measured) {
    if (measured) return;
    report.fail("events, " + std::string(to_string(setting.carrier)) + ", " +
                    std::string(rt::to_string(setting.wait.strategy)) + " wait, " + what,
                measured.error());
  };
  const bool has_peers = !settings.peers.empty();
  // Shared memory stays on one host, and the network between two hosts has no multicast group.
  if (!has_peers && !setting.is_multicast && setting.carrier != Carrier::kSharedMemory) {
    check("two hosts", measure_two_hosts(settings, setting, report));
  }
  for (const int count : settings.consumer_counts) {
    setting.consumer_count = count;
    check(std::to_string(count) + " consumers", measure_fan_out(settings, setting, report));
    if (count == kCrowd && !has_peers) {
      check("some stopped", measure_crowd(settings, setting, report));
    }
  }
  // A rate has no latencies to list.
  if (has_peers || settings.tells_latencies) return {};
  setting.consumer_count = 1;
  return measure_rate(setting, report);
}

}  // namespace rtpm::bench
