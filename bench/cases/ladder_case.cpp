#include <array>
#include <atomic>
#include <bench.rtpm.hpp>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "cases/case.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "runs/event_contender.hpp"
#include "runs/run.hpp"
#include "sides/event_sides.hpp"
#include "sides/rtpm_side.hpp"

// The cost that each layer adds to an event's way from a supplier to a consumer of the same
// program. The middle runs on the other CPU: a call there and back; a call that is handed on by a
// call back; a hub in the same program; a hub in a process of its own; two such hubs, linked. All
// take turns, beside a raw relay of datagrams.
namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr const char* kPath = "bench/relay";
constexpr rt::WaitConfig kBlock{.strategy = rt::WaitStrategy::kBlock};
constexpr Duration kPatience = 10s;

/// A side that has only its supplier.
class CallSide final : public EventSide {
 public:
  using Push = std::function<expected<void, std::string>(const EventStamp&)>;
  explicit CallSide(Push push) : push_(std::move(push)) {}
  expected<void, std::string> push(const EventStamp& stamp) override { return push_(stamp); }

 private:
  Push push_;
};

/// Records each stamp, or passes it to the next object once that is known.
class RelayServantImpl final : public RelayServant {
 public:
  explicit RelayServantImpl(EventBoard* board) : board_(board) {}

  rpc::Result<void> pass(const Stamp& request, const rpc::CallContext&) override {
    pass_count.fetch_add(1);
    static_assert(sizeof(Stamp) == sizeof(EventStamp));
    if (board_ != nullptr) {
      board_->note(0, std::as_bytes(std::span<const Stamp, 1>(&request, 1)), rt::now());
    }
    // A missing object misses it: the first stamps are not measured.
    if (RelayClient* const to = next.load(std::memory_order_acquire); to != nullptr) {
      static_cast<void>(to->pass(request));
    }
    return {};
  }
  std::atomic<std::uint64_t> pass_count{0};
  std::atomic<RelayClient*> next{nullptr};

 private:
  EventBoard* board_;
};

/// Looks for the object until it exists.
expected<RelayClient, std::string> bind_relay(rpc::Node& node, const std::string& url) {
  for (const MonotonicTime give_up = rt::now() + kPatience;; rt::sleep_until(rt::now() + 10ms)) {
    auto client = RelayClient::bind(
        node, url, {.transport = node.config().transport, .warm_up = {kHighPriority}});
    if (client) return std::move(*client);
    if (rt::now() > give_up) return unexpected{client.error().text()};
  }
}

rpc::ServerConfig server_config(const EventSetting& setting, const rt::WaitConfig& wait, int cpu) {
  return {
      .name = "rtpm-bench",
      .lanes = {{.name = "bench-relay", .priority = kHighPriority, .wait = wait, .cpus = {cpu}}},
      .realtime = setting.realtime};
}

/// In the other process: serves, and looks for the object to call back until that is served, too.
expected<std::string, std::string> serve_relay(const EventSetting& setting,
                                               const std::string& call_back) {
  auto& servant = *new RelayServantImpl(nullptr);
  auto server = open_server(server_config(setting, setting.wait, setting.placement.server_cpu),
                            kPath, servant);
  if (!server) return unexpected{server.error()};
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
  auto finder = rt::Thread::start(
      {.name = "bench-finder", .realtime = rt::RealtimeMode::kOff}, [&servant, setting, call_back] {
        auto next = bind_relay(*make_node(setting.carrier, kBlock).release(), call_back);
        if (next) servant.next.store(new RelayClient(std::move(*next)), std::memory_order_release);
      });
  if (!finder) return unexpected{finder.error().text()};
  static_cast<void>(new rt::Thread(std::move(*finder)));
  return (*server).release()->url(kPath);
}

/// An event is a call without reply to another process, which makes another such call back, to an
/// object of this process that records it.
class CallbackChain {
 public:
  CallbackChain(const EventSetting& setting, EventBoard& board)
      : setting_(setting), servant_(&board) {}
  ~CallbackChain() {
    if (server_) server_->stop();
  }
  CallbackChain(const CallbackChain&) = delete;
  CallbackChain& operator=(const CallbackChain&) = delete;

  /// Opens the object that is called back, and starts the other process, which looks for it. Call
  /// it before this process starts a thread.
  [[nodiscard]] expected<void, std::string> start() {
    // Blocks, as consumers of events do.
    auto server = open_server(server_config(setting_, kBlock, setting_.placement.client_cpu), kPath,
                              servant_);
    if (!server) return unexpected{server.error()};
    server_ = std::move(*server);
    auto process = ServerProcess::start(
        [this, url = server_->url(kPath)] { return serve_relay(setting_, url); });
    if (!process) return unexpected{process.error()};
    process_.emplace(std::move(*process));
    return {};
  }

  /// Serves the object and waits until the first stamp came the whole way.
  [[nodiscard]] expected<std::unique_ptr<EventSide>, std::string> connect() {
    if (auto started = server_->start(); !started) return unexpected{started.error().text()};
    const std::shared_ptr<rpc::Node> node = make_node(setting_.carrier, kBlock);
    auto bound = bind_relay(*node, process_->address());
    if (!bound) return unexpected{bound.error()};
    auto side = std::make_unique<CallSide>(
        [node, client = std::make_shared<RelayClient>(std::move(*bound))](
            const EventStamp& stamp) -> expected<void, std::string> {
          Stamp request;
          std::memcpy(static_cast<void*>(&request), &stamp, sizeof request);
          if (auto sent = client->pass(request); !sent) {
            return unexpected{std::string(rpc::to_string(sent.error()))};
          }
          return {};
        });
    for (const MonotonicTime give_up = rt::now() + kPatience; servant_.pass_count == 0;) {
      if (rt::now() > give_up) return unexpected{std::string("nothing is called back")};
      if (auto pushed = side->push({}); !pushed) return unexpected{pushed.error()};
      rt::sleep_until(rt::now() + 10ms);
    }
    return side;
  }

 private:
  EventSetting setting_;
  RelayServantImpl servant_;
  std::unique_ptr<rpc::Server> server_{};
  std::optional<ServerProcess> process_{};
};

/// Starts an echo server in a process of its own, for direct_calls().
expected<ServerProcess, std::string> start_direct(const EventSetting& setting) {
  return ServerProcess::start([&setting] {
    return start_rtpm_server({.lanes = {{.name = "rtpm-high",
                                         .priority = kHighPriority,
                                         .wait = setting.wait,
                                         .cpus = {setting.placement.server_cpu}}},
                              .realtime = setting.realtime});
  });
}

/// An event is a call there and back; its consumer is the caller, which has the event when the
/// reply arrives.
expected<std::unique_ptr<EventSide>, std::string> direct_calls(const EventSetting& setting,
                                                               const std::string& server,
                                                               EventBoard& board) {
  const std::shared_ptr<rpc::Node> node = make_node(setting.carrier, kBlock);
  auto connected = connect_rtpm_caller(*node, server, kHighPriority);
  if (!connected) return unexpected{connected.error()};
  return std::make_unique<CallSide>(
      [node, &board,
       caller = std::shared_ptr<Caller>(std::move(*connected))](const EventStamp& stamp) {
        auto called = caller->echo();
        if (called) board.note(0, std::as_bytes(std::span(&stamp, 1)), rt::now());
        return called;
      });
}

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
  chain = std::make_unique<CallbackChain>(setting, lines[1]->board);
  return chain->start();
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
