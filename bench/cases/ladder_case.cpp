#include <array>
#include <string_view>
#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/event_contender.hpp"
#include "runs/run.hpp"
#include "sides/ladder_sides.hpp"

// The cost that each layer adds to an event's way from a supplier to a consumer of the same
// program. The middle runs on the other CPU: a call there and back; a call that is handed on by a
// call back; a hub in the same program; a hub in a process of its own; two such hubs, linked. All
// take turns, beside a raw relay of datagrams.
namespace rtpm::bench {
namespace {

constexpr std::array<std::string_view, 6> kRungs{"direct call", "callback",    "embedded hub",
                                                 "hub process", "linked hubs", "raw relay"};

/// The processes of all rungs, and the objects in this one.
struct Ladder {
  EventSetting setting;
  std::vector<ServerProcess> processes{};  ///< Direct, hub, linked hub, relay.
  std::vector<std::shared_ptr<EventLine>> lines{};
  std::unique_ptr<CallbackChain> chain{};
  std::unique_ptr<EventHub> own_hub{};

  [[nodiscard]] expected<void, std::string> start();
  [[nodiscard]] expected<Contenders, std::string> connect();
};

expected<void, std::string> Ladder::start() {
  for (std::size_t rung = 0; rung < kRungs.size(); ++rung)
    lines.push_back(std::make_shared<EventLine>(1));
  for (const auto& begin : {start_direct, start_event_hub, start_event_hub, start_event_relay}) {
    EventSetting its_setting = setting;
    if (processes.size() == 2) its_setting.linked_to = processes[1].address();
    auto process = begin(its_setting);
    if (!process) return unexpected{process.error()};
    processes.push_back(std::move(*process));
  }
  auto started = CallbackChain::start(setting, lines[1]->board);
  if (!started) return unexpected{started.error()};
  chain = std::move(*started);
  return {};
}

expected<Contenders, std::string> Ladder::connect() {
  EventSetting embedded = setting;
  embedded.is_embedded = true;
  auto opened = open_event_hub(embedded);
  if (!opened) return unexpected{opened.error()};
  own_hub = std::move(*opened);
  // Another type, so that the second hub takes no events of the rung before it.
  EventSetting linked = setting;
  linked.type = setting.type + 1;
  linked.pushed_to = processes[1].address();
  const std::array<std::function<expected<std::unique_ptr<EventSide>, std::string>(EventBoard&)>,
                   kRungs.size()>
      connects{
          [&](EventBoard& board) { return direct_calls(setting, processes[0].address(), board); },
          [&](EventBoard&) { return chain->connect(); },
          [&](EventBoard& board) { return connect_events(embedded, own_hub->url(), board); },
          [&](EventBoard& board) { return connect_events(setting, processes[1].address(), board); },
          [&](EventBoard& board) { return connect_events(linked, processes[2].address(), board); },
          [&](EventBoard& board) { return connect_relay(setting, processes[3].address(), board); }};
  Contenders contenders;
  for (std::size_t rung = 0; rung < kRungs.size(); ++rung) {
    auto side = connects[rung](lines[rung]->board);
    if (!side) return unexpected{std::string(kRungs[rung]) + ": " + side.error()};
    lines[rung]->side = std::move(*side);
    contenders.push_back(std::make_unique<EventContender>(lines[rung], 1));
  }
  return contenders;
}

expected<void, std::string> measure(const Settings& settings, const DuelConfig& config,
                                    Report& report) {
  Run run(settings,
          {.sample_count = 2'000, .turn_size = kEventBlockSize, .rate_hz = settings.rate_hz},
          report);
  auto measured = run.measure([&]() -> expected<Connect, std::string> {
    auto ladder = std::make_shared<Ladder>(Ladder{{.carrier = config.carrier,
                                                   .wait = config.wait,
                                                   .placement = config.placement,
                                                   .realtime = config.realtime}});
    if (auto started = ladder->start(); !started) return unexpected{started.error()};
    return Connect([ladder] { return ladder->connect(); });
  });
  if (!measured) return measured;
  for (std::size_t rung = 0; rung + 1 < kRungs.size(); ++rung) {
    Json head = head_of("ladder", config);
    head["rung"] = kRungs[rung];
    head["payload"] = sizeof(EventStamp);
    report.add(run.result(head, rung));
  }
  return {};
}

}  // namespace

void run_ladder(const Settings& settings, Report& report) {
  measure_each("ladder", settings, report, true, measure);
}

}  // namespace rtpm::bench
