#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "runs/event_run.hpp"
#include "sides/event_sides.hpp"
#include "sides/ladder_sides.hpp"

// What each layer adds to an event's way from a supplier to a consumer of the same program, with
// what is between on the other CPU: a call there and back; a call that is handed on by a call back;
// a hub in the same program; a hub in a process of its own; two such hubs, linked. All by turns,
// beside a raw relay of datagrams.
namespace rtpm::bench {
namespace {

constexpr std::array<std::string_view, 6> kRungs{"direct call", "callback",    "embedded hub",
                                                 "hub process", "linked hubs", "raw relay"};
constexpr std::size_t kFloor = 5;
constexpr std::uint64_t kEventCountDefault = 2'000;

using namespace std::chrono_literals;

class Ladder {
 public:
  Ladder(const Settings& settings, const EventSetting& setting)
      : settings_(settings), setting_(setting), board_(1, kEventBlockSize) {}

  /// Starts the processes, before this one has a thread.
  [[nodiscard]] expected<void, std::string> start();
  /// On a thread as run_as_caller() has it.
  [[nodiscard]] expected<void, std::string> measure();
  void report(Report& report) const;

 private:
  [[nodiscard]] expected<void, std::string> add(
      expected<std::unique_ptr<EventSide>, std::string> side);
  [[nodiscard]] expected<void, std::string> connect();
  [[nodiscard]] expected<void, std::string> warm_up(EventSide& side);

  const Settings& settings_;
  EventSetting setting_;
  EventBoard board_;
  std::vector<ServerProcess> processes_{};  ///< Direct, hub, linked hub, relay.
  std::unique_ptr<CallbackChain> chain_{};
  std::unique_ptr<EventHub> own_hub_{};
  std::vector<std::unique_ptr<EventSide>> sides_{};  ///< In the order of kRungs.
  std::vector<EventFinding> findings_{};
  std::optional<DisturbanceWatch> watch_{};
  std::uint32_t block_ = 0;
};

expected<void, std::string> Ladder::start() {
  for (const auto& begin : {start_direct, start_event_hub}) {
    auto process = begin(setting_);
    if (!process) return unexpected{process.error()};
    processes_.push_back(std::move(*process));
  }
  EventSetting linked = setting_;
  linked.linked_to = processes_[1].address();
  auto second = start_event_hub(linked);
  if (!second) return unexpected{second.error()};
  processes_.push_back(std::move(*second));
  auto relay = start_event_relay(setting_);
  if (!relay) return unexpected{relay.error()};
  processes_.push_back(std::move(*relay));
  auto chain = CallbackChain::start(setting_, board_);
  if (!chain) return unexpected{chain.error()};
  chain_ = std::move(*chain);
  return {};
}

expected<void, std::string> Ladder::add(expected<std::unique_ptr<EventSide>, std::string> side) {
  if (!side) {
    return unexpected{std::string(kRungs[sides_.size()]) + ": " + side.error()};
  }
  sides_.push_back(std::move(*side));
  return {};
}

expected<void, std::string> Ladder::connect() {
  EventSetting embedded = setting_;
  embedded.is_embedded = true;
  auto own_hub = open_event_hub(embedded);
  if (!own_hub) return unexpected{own_hub.error()};
  own_hub_ = std::move(*own_hub);
  const std::string& hub = processes_[1].address();
  auto added = add(direct_calls(setting_, processes_[0].address(), board_));
  if (added) added = add(chain_->connect());
  if (added) added = add(connect_events(embedded, own_hub_->url(), board_));
  if (added) added = add(connect_events(setting_, hub, board_));
  // Of another type, so that the second hub takes nothing of what the rung before it pushes.
  EventSetting linked = setting_;
  linked.type = setting_.type + 1;
  linked.pushed_to = hub;
  if (added) added = add(connect_events(linked, processes_[2].address(), board_));
  if (added) added = add(connect_relay(setting_, processes_[3].address(), board_));
  return added;
}

/// Until an event came the whole way: links take a moment.
expected<void, std::string> Ladder::warm_up(EventSide& side) {
  const MonotonicTime give_up = rt::now() + 5s;
  board_.begin(++block_);
  while (board_.arrived_count() == 0) {
    if (rt::now() > give_up) return unexpected{std::string("no event arrives")};
    if (auto pushed = side.push({.due_ns = to_ns(rt::now()), .block = block_}); !pushed) {
      return pushed;
    }
    rt::sleep_until(rt::now() + 5ms);
  }
  return {};
}

expected<void, std::string> Ladder::measure() {
  if (auto connected = connect(); !connected) return connected;
  const std::size_t per_round = samples_per_round(settings_, kEventCountDefault);
  const Duration period{static_cast<std::int64_t>(1e9 / settings_.rate_hz)};
  for (std::size_t rung = 0; rung < kRungs.size(); ++rung) {
    findings_.emplace_back(settings_.round_count, per_round, 1);
    if (auto warm = warm_up(*sides_[rung]); !warm) {
      return unexpected{std::string(kRungs[rung]) + ": " + warm.error()};
    }
  }
  std::vector<pid_t> servers{chain_->id()};
  for (const ServerProcess& process : processes_)
    servers.push_back(process.id());
  watch_.emplace(servers);
  for (int round = 0; round < settings_.round_count; ++round) {
    for (EventFinding& finding : findings_)
      finding.begin_round(round);
    const RoundWatch round_watch;
    for (std::size_t done = 0; done < per_round; done += kEventBlockSize) {
      const std::size_t events = std::min(kEventBlockSize, per_round - done);
      // Who goes first changes from turn to turn, and so does who goes before whom.
      const std::size_t first = done / kEventBlockSize + static_cast<std::size_t>(round);
      for (std::size_t i = 0; i < kRungs.size(); ++i) {
        const std::size_t place = first % 2 == 0 ? i : kRungs.size() - 1 - i;
        const std::size_t rung = (place + first / 2) % kRungs.size();
        auto measured =
            measure_events(period, events, *sides_[rung], board_, ++block_, 1, findings_[rung]);
        if (!measured) return measured;
      }
    }
    const bool was_disturbed = round_watch.was_disturbed();
    for (EventFinding& finding : findings_)
      finding.note_disturbed(was_disturbed);
  }
  return {};
}

void Ladder::report(Report& report) const {
  const DuelConfig config{
      .carrier = setting_.carrier, .wait = setting_.wait, .payload_size = sizeof(EventStamp)};
  for (std::size_t rung = 0; rung < kFloor; ++rung) {
    Result result{.title = "ladder, " + std::string(kRungs[rung]) + ", " +
                           std::string(to_string(setting_.carrier))};
    result.json.add("rung", kRungs[rung]);
    add_comparison(result, "ladder", config, findings_[rung].each, findings_[kFloor].each);
    result.json.add("rate_hz", settings_.rate_hz);
    result.json.add("missing", static_cast<std::int64_t>(findings_[rung].missing_count));
    watch_->finish(result, longest_us(result));
    report.add(result);
  }
}

}  // namespace

bool run_ladder(const Settings& settings, Report& report) {
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const EventSetting setting{.carrier = carrier,
                                 .wait = {.strategy = strategy, .spin = settings.spin},
                                 .placement = choose_placement(),
                                 .realtime = settings.realtime};
      const std::string title = "ladder, " + std::string(to_string(carrier)) + ", " +
                                std::string(rt::to_string(strategy)) + " wait";
      if (strategy == rt::WaitStrategy::kSpin) {
        say_not_measured(title,
                         "several servers share a CPU, of which one that spins would "
                         "starve the others; use --wait adaptive or --wait block");
        is_complete = false;
        continue;
      }
      Ladder ladder(settings, setting);
      auto measured = ladder.start();
      const DuelConfig caller{.placement = setting.placement, .realtime = setting.realtime};
      if (measured) measured = run_as_caller(caller, [&] { return ladder.measure(); });
      if (measured) {
        ladder.report(report);
      } else {
        say_not_measured(title, measured.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
