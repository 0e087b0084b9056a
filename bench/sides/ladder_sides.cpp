#include "sides/ladder_sides.hpp"

#include <atomic>
#include <bench.rtpm.hpp>
#include <cstring>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "sides/rtpm_side.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr const char* kPath = "bench/relay";
constexpr rt::WaitConfig kBlock{.strategy = rt::WaitStrategy::kBlock};
constexpr Duration kPatience = 10s;

/// The caller is the consumer, too.
class DirectSide final : public EventSide {
 public:
  DirectSide(std::unique_ptr<rpc::Node> node, std::unique_ptr<Caller> caller, EventBoard& board)
      : node_(std::move(node)), caller_(std::move(caller)), board_(board) {}

  expected<void, std::string> push(const EventStamp& stamp) override {
    if (auto called = caller_->echo(); !called) return called;
    board_.note(0, std::as_bytes(std::span<const EventStamp, 1>(&stamp, 1)), rt::now());
    return {};
  }

 private:
  std::unique_ptr<rpc::Node> node_;
  std::unique_ptr<Caller> caller_;
  EventBoard& board_;
};

/// Notes what comes, or hands it on once it knows to whom.
class RelayServantImpl final : public RelayServant {
 public:
  explicit RelayServantImpl(EventBoard* board) : board_(board) {}

  rpc::Result<void> pass(const Stamp& request, const rpc::CallContext&) override {
    pass_count.fetch_add(1);
    if (board_ != nullptr) {
      EventStamp stamp;
      static_assert(sizeof(Stamp) == sizeof(EventStamp));
      std::memcpy(static_cast<void*>(&stamp), &request, sizeof stamp);
      board_->note(0, std::as_bytes(std::span<const EventStamp, 1>(&stamp, 1)), rt::now());
    }
    // Whoever is not there yet misses it: the first stamps are no measured ones.
    if (RelayClient* const next = next_.load(std::memory_order_acquire); next != nullptr) {
      static_cast<void>(next->pass(request));
    }
    return {};
  }
  void hand_on_to(RelayClient& next) { next_.store(&next, std::memory_order_release); }
  std::atomic<std::uint64_t> pass_count{0};

 private:
  EventBoard* board_;
  std::atomic<RelayClient*> next_{nullptr};
};

expected<RelayClient, std::string> bind_relay(rpc::Node& node, const std::string& url) {
  auto client = RelayClient::bind(
      node, url, {.transport = node.config().transport, .warm_up = {kHighPriority}});
  if (!client) return unexpected{client.error().text()};
  return std::move(*client);
}

rpc::ServerConfig server_config(const EventSetting& setting, const rt::WaitConfig& wait, int cpu) {
  return {
      .name = "rtpm-bench",
      .lanes = {{.name = "bench-relay", .priority = kHighPriority, .wait = wait, .cpus = {cpu}}},
      .realtime = setting.realtime};
}

/// In the other process: serves, and looks for whom to call back until he serves, too.
expected<std::string, std::string> serve_relay(const EventSetting& setting,
                                               const std::string& call_back) {
  auto& servant = *new RelayServantImpl(nullptr);
  auto server =
      rpc::Server::create(server_config(setting, setting.wait, setting.placement.server_cpu));
  if (!server) return unexpected{server.error().text()};
  if (auto added = (*server)->add(kPath, servant); !added) return unexpected{added.error().text()};
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
  auto finder = rt::Thread::start(
      {.name = "bench-finder", .realtime = rt::RealtimeMode::kOff}, [&servant, setting, call_back] {
        auto& node = *make_node(setting.carrier, kBlock).release();
        for (const MonotonicTime give_up = rt::now() + kPatience; rt::now() < give_up;) {
          auto next = bind_relay(node, call_back);
          if (next) return servant.hand_on_to(*new RelayClient(std::move(*next)));
          rt::sleep_until(rt::now() + 10ms);
        }
      });
  if (!finder) return unexpected{finder.error().text()};
  static_cast<void>(new rt::Thread(std::move(*finder)));
  return (*server).release()->url(kPath);
}

class CallbackSide final : public EventSide {
 public:
  CallbackSide(std::unique_ptr<rpc::Node> node, RelayClient client)
      : node_(std::move(node)), client_(std::move(client)) {}

  expected<void, std::string> push(const EventStamp& stamp) override {
    Stamp request;
    std::memcpy(static_cast<void*>(&request), &stamp, sizeof request);
    if (auto sent = client_.pass(request); !sent) {
      return unexpected{std::string(rpc::to_string(sent.error()))};
    }
    return {};
  }

 private:
  std::unique_ptr<rpc::Node> node_;
  RelayClient client_;
};

class CallbackChainImpl final : public CallbackChain {
 public:
  CallbackChainImpl(const EventSetting& setting, EventBoard& board)
      : setting_(setting), servant_(&board) {}
  ~CallbackChainImpl() override {
    if (server_) server_->stop();
  }

  [[nodiscard]] expected<void, std::string> start() {
    // Blocks, as consumers of events do.
    auto server =
        rpc::Server::create(server_config(setting_, kBlock, setting_.placement.client_cpu));
    if (!server) return unexpected{server.error().text()};
    server_ = std::move(*server);
    if (auto added = server_->add(kPath, servant_); !added) return unexpected{added.error().text()};
    // Its socket is open, so that its address is known; it serves from connect() on.
    auto process = ServerProcess::start(
        [this, url = server_->url(kPath)] { return serve_relay(setting_, url); });
    if (!process) return unexpected{process.error()};
    process_.emplace(std::move(*process));
    return {};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect() override {
    if (auto started = server_->start(); !started) return unexpected{started.error().text()};
    auto node = make_node(setting_.carrier, kBlock);
    auto client = bind_relay(*node, process_->address());
    if (!client) return unexpected{client.error()};
    auto side = std::make_unique<CallbackSide>(std::move(node), std::move(*client));
    for (const MonotonicTime give_up = rt::now() + kPatience; servant_.pass_count == 0;) {
      if (rt::now() > give_up) return unexpected{std::string("nothing is called back")};
      if (auto pushed = side->push({}); !pushed) return unexpected{pushed.error()};
      rt::sleep_until(rt::now() + 10ms);
    }
    return std::unique_ptr<EventSide>(std::move(side));
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
  return ServerProcess::start([setting] {
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
  auto node = make_node(setting.carrier, kBlock);
  auto caller = connect_rtpm_caller(*node, server, kHighPriority);
  if (!caller) return unexpected{caller.error()};
  return std::unique_ptr<EventSide>(
      std::make_unique<DirectSide>(std::move(node), std::move(*caller), board));
}

expected<std::unique_ptr<CallbackChain>, std::string> CallbackChain::start(
    const EventSetting& setting, EventBoard& board) {
  auto chain = std::make_unique<CallbackChainImpl>(setting, board);
  if (auto started = chain->start(); !started) return unexpected{started.error()};
  return std::unique_ptr<CallbackChain>(std::move(chain));
}

}  // namespace rtpm::bench
