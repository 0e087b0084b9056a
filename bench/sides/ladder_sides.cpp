#include "sides/ladder_sides.hpp"

#include <atomic>
#include <bench.rtpm.hpp>
#include <cstring>
#include <optional>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "sides/rtpm_side.hpp"

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

class CallbackChainImpl final : public CallbackChain {
 public:
  CallbackChainImpl(const EventSetting& setting, EventBoard& board)
      : setting_(setting), servant_(&board) {}
  ~CallbackChainImpl() override {
    if (server_) server_->stop();
  }

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

  expected<std::unique_ptr<EventSide>, std::string> connect() override {
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
  pid_t id() const override { return process_->id(); }

 private:
  EventSetting setting_;
  RelayServantImpl servant_;
  std::unique_ptr<rpc::Server> server_{};
  std::optional<ServerProcess> process_{};
};

}  // namespace

expected<ServerProcess, std::string> start_direct(const EventSetting& setting) {
  return ServerProcess::start([&setting] {
    return start_rtpm_server({.lanes = {{.name = "rtpm-high",
                                         .priority = kHighPriority,
                                         .wait = setting.wait,
                                         .cpus = {setting.placement.server_cpu}}},
                              .realtime = setting.realtime});
  });
}

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

expected<std::unique_ptr<CallbackChain>, std::string> CallbackChain::start(
    const EventSetting& setting, EventBoard& board) {
  auto chain = std::make_unique<CallbackChainImpl>(setting, board);
  if (auto started = chain->start(); !started) return unexpected{started.error()};
  return chain;
}

}  // namespace rtpm::bench
