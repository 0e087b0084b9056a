#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/event_contender.hpp"
#include "runs/run.hpp"

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

/// The middle between supplier and consumers: processes of their own or, started on the caller's
/// thread, a hub in this program and no relay.
struct Middle {
  std::vector<ServerProcess> processes{};  ///< The hub and the relay.
  std::unique_ptr<EventHub> own_hub{};
};

expected<Contenders, std::string> connect(const EventSetting& setting, Middle& middle) {
  if (setting.network != nullptr) {
    if (auto entered = setting.network->enter(NetworkPair::Host::kClient); !entered) {
      return unexpected{entered.error()};
    }
  }
  std::array<std::string, 2> addresses;
  if (setting.has_own_hub) {
    auto hub = open_event_hub(setting);
    if (!hub) return unexpected{hub.error()};
    middle.own_hub = std::move(*hub);
    addresses[0] = middle.own_hub->url();
  } else {
    std::ranges::transform(middle.processes, addresses.begin(), &ServerProcess::address);
  }
  Contenders contenders;
  for (const auto& [connect_side, address] :
       {std::pair{&connect_events, addresses[0]}, std::pair{&connect_relay, addresses[1]}}) {
    auto line = std::make_shared<EventLine>(setting.consumer_count);
    auto side = connect_side(setting, address, line->board);
    if (!side) return unexpected{side.error()};
    line->side = std::move(*side);
    contenders.push_back(std::make_unique<EventContender>(line, setting.consumer_count));
  }
  return contenders;
}

/// Hub and relay by turns, and peers.
expected<void, std::string> measure_fan_out(const Settings& settings, const EventSetting& setting,
                                            Report& report) {
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
  auto measured = run.measure([&]() -> expected<Connect, std::string> {
    auto middle = std::make_shared<Middle>();
    if (!setting.has_own_hub) {
      for (const auto& start : {start_event_hub, start_event_relay}) {
        auto process = start(setting);
        if (!process) return unexpected{process.error()};
        middle->processes.push_back(std::move(*process));
      }
    }
    return Connect([&, middle] { return connect(setting, *middle); });
  });
  if (measured) run.report(head_of(setting));
  return measured;
}

/// Measures the other consumers while some are stopped and some slow, or while all are well.
class CrowdContender final : public Contender {
 public:
  CrowdContender(std::shared_ptr<EventLine> line, const ServerProcess* stopped)
      : line_(std::move(line)), stopped_(stopped), others_(line_, kOthers) {}

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    line_->side->set_slow(stopped_ != nullptr ? kSlow : 0);
    if (stopped_ != nullptr) stopped_->pause();
    auto taken = others_.take_turn(plan, finding);
    if (stopped_ != nullptr) stopped_->resume();
    return taken;
  }

 private:
  std::shared_ptr<EventLine> line_;
  const ServerProcess* stopped_;
  EventContender others_;
};

expected<void, std::string> measure_crowd(const Settings& settings, EventSetting setting,
                                          Report& report) {
  setting.consumer_count = kCrowd - kStopped;
  RunPlan plan = plan_of(settings);
  plan.part_count = 1;
  Run run(settings, plan, report);
  auto measured = run.measure([&]() -> expected<Connect, std::string> {
    auto hub = start_event_hub(setting);
    if (!hub) return unexpected{hub.error()};
    auto idle = start_idle_consumers(setting, hub->address(), kStopped);
    if (!idle) return unexpected{idle.error()};
    const auto both = std::make_shared<std::array<ServerProcess, 2>>(
        std::array{std::move(*hub), std::move(*idle)});
    return Connect([&, both]() -> expected<Contenders, std::string> {
      auto line = std::make_shared<EventLine>(kOthers);
      auto side = connect_events(setting, (*both)[0].address(), line->board);
      if (!side) return unexpected{side.error()};
      line->side = std::move(*side);
      Contenders contenders;
      contenders.push_back(std::make_unique<CrowdContender>(line, &(*both)[1]));
      contenders.push_back(std::make_unique<CrowdContender>(line, nullptr));
      return contenders;
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

expected<void, std::string> measure_rate(const EventSetting& setting, Report& report) {
  const auto hub = start_event_hub(setting);
  if (!hub) return unexpected{hub.error()};
  const auto measured = measure_event_rate(setting, hub->address());
  if (!measured) return unexpected{measured.error()};
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
expected<void, std::string> measure_two_hosts(const Settings& settings, EventSetting setting,
                                              Report& report) {
  const auto network = NetworkPair::create();
  if (!network) return unexpected{network.error()};
  setting.network = &*network;
  setting.consumer_count = 1;
  return measure_fan_out(settings, setting, report);
}

/// Measures all that it can, whatever else fails.
expected<void, std::string> measure(const Settings& settings, const DuelConfig& config,
                                    Report& report) {
  EventSetting setting{.carrier = config.carrier,
                       .wait = config.wait,
                       .has_own_hub = settings.has_own_hub,
                       .is_multicast = settings.has_multicast,
                       .placement = config.placement,
                       .realtime = config.realtime};
  const auto check = [&](const std::string& what, const expected<void, std::string>& measured) {
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

}  // namespace

void run_events(const Settings& settings, Report& report) {
  measure_each("events", settings, report, false, measure);
}

}  // namespace rtpm::bench
