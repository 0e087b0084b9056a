#include <memory>
#include <utility>
#include <vector>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "figures/disturbance.hpp"
#include "runs/event_run.hpp"
#include "runs/peer_table.hpp"
#include "runs/turn_run.hpp"
#include "sides/event_sides.hpp"

namespace rtpm::bench {
namespace {

/// Hub or relay with its supplier and consumers.
class EventContender final : public Contender {
 public:
  explicit EventContender(int consumer_count)
      : consumer_count_(consumer_count),
        board_(static_cast<std::size_t>(consumer_count), kEventBlockSize) {}

  [[nodiscard]] EventBoard& board() noexcept { return board_; }
  void set_side(std::unique_ptr<EventSide> side) { side_ = std::move(side); }
  [[nodiscard]] std::uint64_t missing_count() const noexcept { return missing_count_; }

  expected<void, std::string> take_turn(const TurnPlan& plan, Samples& high,
                                        Samples& low) override {
    EventFinding finding(1, kEventBlockSize, consumer_count_);
    auto measured = measure_events(Duration{plan.period_ns}, static_cast<std::size_t>(plan.count),
                                   *side_, board_, ++block_, consumer_count_, finding);
    for (const Duration latency : finding.each.of_round(0))
      high.add(latency);
    for (const Duration latency : finding.last.of_round(0))
      low.add(latency);
    missing_count_ += finding.missing_count;
    return measured;
  }

 private:
  int consumer_count_;
  EventBoard board_;
  std::uint32_t block_ = 0;
  std::uint64_t missing_count_ = 0;
  std::unique_ptr<EventSide> side_{};  ///< Notes to the board, so it ends first.
};

using ConnectSide = expected<std::unique_ptr<EventSide>, std::string> (*)(const EventSetting&,
                                                                          const std::string&,
                                                                          EventBoard&);

expected<std::unique_ptr<EventContender>, std::string> connect(const EventSetting& setting,
                                                               const std::string& server,
                                                               ConnectSide connect_side) {
  auto contender = std::make_unique<EventContender>(setting.consumer_count);
  auto side = connect_side(setting, server, contender->board());
  if (!side) return unexpected{side.error()};
  contender->set_side(std::move(*side));
  return contender;
}

Result result_of_peer(const Settings& settings, const EventSetting& setting,
                      const TurnRun::Entrant& peer, const Deliveries& rtpm,
                      const Deliveries& floor) {
  const TurnRun::Finding& finding = peer.findings.at(0);
  Result result;
  JsonObject& json = result.json;
  json.add("case", "events");
  json.add("peer", peer.peer->name());
  json.add("transport", peer.peer->transport());
  if (setting.has_own_hub) json.add("hub", kOwnHub);
  if (setting.is_multicast) json.add("delivery", kMulticast);
  json.add("payload", static_cast<std::int64_t>(sizeof(EventStamp)));
  json.add("n", static_cast<std::int64_t>(finding.low.count()));
  json.add("rate_hz", settings.rate_hz);
  json.add("consumers", setting.consumer_count);
  add_distribution(json, "each_", finding.high);
  add_distribution(json, "last_", finding.low);
  json.add("missing", static_cast<std::int64_t>(peer.peer->missing_count()));
  json.add("rtpm_transport", to_string(setting.carrier));
  json.add("rtpm_wait", rt::to_string(setting.wait.strategy));
  add_distribution(json, "rtpm_each_", rtpm.each);
  add_distribution(json, "rtpm_last_", rtpm.last);
  json.add("rtpm_missing", static_cast<std::int64_t>(rtpm.missing_count));
  add_distribution(json, "floor_each_", floor.each);
  add_distribution(json, "floor_last_", floor.last);
  add_ratios(json, "rtpm_over_peer_each_", rtpm.each, finding.high);
  add_ratios(json, "rtpm_over_peer_last_", rtpm.last, finding.low);
  add_rounds(result, rtpm.last, finding.low);
  return result;
}

void report_all(const Settings& settings, const EventSetting& setting, const TurnRun& run,
                const Deliveries& rtpm, const Deliveries& floor, const DisturbanceWatch& watch,
                Report& report) {
  Result result{.title = title_of(setting)};
  add_fan_out(result, settings, setting, rtpm, floor);
  for (const TurnRun::Entrant& entrant : run.entrants()) {
    if (entrant.peer == nullptr) continue;
    const TurnRun::Finding& finding = entrant.findings.at(0);
    result.rows.push_back({entrant.title + ", each", finding.high.percentiles()});
    result.rows.push_back({entrant.title + ", last", finding.low.percentiles()});
  }
  const double longest_us = rtpm.last.percentiles().max;
  watch.finish(result, longest_us);
  report.add(result);
  for (const TurnRun::Entrant& entrant : run.entrants()) {
    if (entrant.peer == nullptr) continue;
    Result of_peer = result_of_peer(settings, setting, entrant, rtpm, floor);
    watch.finish(of_peer, longest_us);
    report.add(of_peer);
  }
}

/// What is between supplier and consumers: processes of their own, or, begun on the caller's
/// thread, a hub in this program and no relay.
struct Middle {
  std::vector<ServerProcess> processes{};
  std::unique_ptr<EventHub> own_hub{};
  std::string hub{};
  std::string relay{};
};

expected<Middle, std::string> start_middle(const EventSetting& setting) {
  Middle middle;
  if (setting.has_own_hub) return middle;
  for (const auto& start : {start_event_hub, start_event_relay}) {
    auto process = start(setting);
    if (!process) return unexpected{process.error()};
    middle.processes.push_back(std::move(*process));
  }
  middle.hub = middle.processes[0].address();
  middle.relay = middle.processes[1].address();
  return middle;
}

expected<bool, std::string> measure_beside(const Settings& settings, const EventSetting& setting,
                                           const PeerChoice& choice, Report& report) {
  const CasePlan plan{.name = "events",
                      .sample_count = 2'000,
                      .turn_size = kEventBlockSize,
                      .rate_hz = settings.rate_hz};
  auto middle = start_middle(setting);
  if (!middle) return unexpected{middle.error()};
  TurnRun run(settings, plan);
  run.start_peers(choice, "events", setting.carrier,
                  {.placement = setting.placement,
                   .realtime = setting.realtime,
                   .consumer_count = setting.consumer_count});
  if (!run.has_peers()) return run.is_complete();
  const DuelConfig caller{.placement = setting.placement, .realtime = setting.realtime};
  std::vector<pid_t> servers;
  for (const ServerProcess& process : middle->processes)
    servers.push_back(process.id());
  const DisturbanceWatch watch(servers);
  auto measured = run_as_caller(caller, [&]() -> expected<void, std::string> {
    if (setting.has_own_hub) {
      auto hub = open_event_hub(setting);
      if (!hub) return unexpected{hub.error()};
      middle->own_hub = std::move(*hub);
      middle->hub = middle->own_hub->url();
    }
    auto rtpm = connect(setting, middle->hub, connect_events);
    if (!rtpm) return unexpected{rtpm.error()};
    auto floor = connect(setting, middle->relay, connect_relay);
    if (!floor) return unexpected{floor.error()};
    const EventContender& of_rtpm = **rtpm;
    const EventContender& of_floor = **floor;
    if (auto done = run.measure(std::move(*rtpm), std::move(*floor), setting.placement,
                                run.parts().front());
        !done)
      return done;
    const auto deliveries = [&](std::size_t which, const EventContender& contender) {
      const TurnRun::Finding& finding = run.entrants()[which].findings.at(0);
      return Deliveries{finding.high, finding.low, contender.missing_count()};
    };
    report_all(settings, setting, run, deliveries(0, of_rtpm), deliveries(1, of_floor), watch,
               report);
    return {};
  });
  if (!measured) return unexpected{measured.error()};
  return run.is_complete();
}

}  // namespace

bool run_events_with_peers(const Settings& settings, Report& report) {
  auto choice = choose_peers(settings.peers);
  if (!choice) return false;
  bool is_complete = true;
  if (settings.has_own_hub) {
    const std::size_t broker_count =
        std::erase_if(choice->peers, [](const PeerEntry* peer) { return peer->has_broker; });
    if (choice->is_by_name && broker_count > 0) {
      say_not_measured("events",
                       "--own-hub is for peers without a broker, which one of those named "
                       "has");
      is_complete = false;
    }
  }
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      for (const int consumer_count : settings.consumer_counts) {
        const EventSetting setting{.carrier = carrier,
                                   .wait = {.strategy = strategy, .spin = settings.spin},
                                   .consumer_count = consumer_count,
                                   .has_own_hub = settings.has_own_hub,
                                   .is_multicast = settings.has_multicast,
                                   .placement = choose_placement(),
                                   .realtime = settings.realtime,
                                   .has_own_threads = settings.has_own_threads};
        const auto measured = measure_beside(settings, setting, *choice, report);
        if (!measured) say_not_measured(title_of(setting), measured.error());
        is_complete = measured && *measured && is_complete;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
