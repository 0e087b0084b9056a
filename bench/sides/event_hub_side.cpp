#include <unistd.h>

#include <atomic>
#include <vector>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/events/link.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "sides/event_sides.hpp"
#include "sides/rtpm_side.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr Duration kSetUpPatience = 10s;
constexpr std::uint32_t kConsumerCountMax = 512;
constexpr const char* kLoopback = "127.0.0.1";

/// A group that stays on this host, at a port of this process's own.
events::MulticastConfig multicast_config() {
  const auto port = static_cast<std::uint16_t>(20'000 + getpid() % 40'000);
  return {.group = {.group = "239.255.42.2", .port = port, .interface = kLoopback, .hops = 0}};
}

rpc::Transport consumer_transport_of(const EventSetting& setting) {
  return setting.is_embedded ? rpc::Transport::kLocal : transport_of(setting.carrier);
}

rpc::Transport supplier_transport_of(const EventSetting& setting) {
  return setting.has_own_hub ? rpc::Transport::kLocal : consumer_transport_of(setting);
}

rpc::NodeConfig node_config(const rt::WaitConfig& wait) {
  rpc::NodeConfig config;
  config.wait = wait;
  config.channel_count_max = kConsumerCountMax + 64;
  return config;
}

// Consumers block, on both sides: many that spin on one CPU would starve each other.
constexpr rt::WaitConfig kBlock{.strategy = rt::WaitStrategy::kBlock};

class Noter final : public events::EventHandler {
 public:
  Noter(EventBoard* board, std::size_t number) : board_(board), number_(number) {}
  void on_events(std::span<const events::EventView> events) override {
    if (board_ != nullptr) board_->note(number_, events[0].payload, rt::now());
    count.fetch_add(events.size(), std::memory_order_relaxed);
    if (is_slow.load(std::memory_order_relaxed)) rt::sleep_until(rt::now() + 100ms);
  }
  std::atomic<bool> is_slow{false};
  std::atomic<std::uint64_t> count{0};

 private:
  EventBoard* board_;
  std::size_t number_;
};

/// A supplier, and consumers with a handler each. Both have nodes of their own.
class HubSide final : public EventSide {
 public:
  [[nodiscard]] expected<void, std::string> add_supplier(const EventSetting& setting,
                                                         const std::string& hub) {
    auto supplier = events::Supplier::create(supplier_node_, hub,
                                             {.name = "bench",
                                              .priority = kHighPriority,
                                              .transport = supplier_transport_of(setting),
                                              .deadline = kSetUpPatience});
    if (!supplier) return unexpected{supplier.error().text()};
    supplier_ = std::move(*supplier);
    type_ = setting.type;
    return {};
  }

  /// `board` is null if no arrival is recorded.
  [[nodiscard]] expected<void, std::string> add_consumers(const EventSetting& setting,
                                                          const std::string& hub, int count,
                                                          std::uint32_t capacity,
                                                          EventBoard* board) {
    const events::ConsumerConfig config{
        .name = "bench",
        .filter = events::of_type(setting.type),
        .delivery = {.queue_capacity = capacity},
        .priority = kHighPriority,
        .cpus = {setting.placement.client_cpu},
        .realtime = setting.realtime,
        .transport = consumer_transport_of(setting),
        .shared_ring = !setting.is_embedded && setting.carrier == Carrier::kSharedMemory,
        .multicast = setting.is_multicast,
        .multicast_interface = kLoopback,
        .deadline = kSetUpPatience};
    for (int i = 0; i < count; ++i) {
      handlers_.push_back(std::make_unique<Noter>(board, handlers_.size()));
      auto consumer = events::Consumer::create(consumer_node_, hub, config, *handlers_.back());
      if (!consumer) return unexpected{consumer.error().text()};
      consumers_.push_back(std::move(*consumer));
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    const auto pushed = supplier_->push(
        {.type = type_, .payload = std::as_bytes(std::span<const EventStamp, 1>(&stamp, 1))});
    if (pushed) return {};
    return unexpected{std::string(rpc::to_string(pushed.error()))};
  }
  void set_slow(int count) override {
    const auto first = handlers_.size() - static_cast<std::size_t>(count);
    for (std::size_t i = 0; i < handlers_.size(); ++i)
      handlers_[i]->is_slow = i >= first;
  }
  std::uint64_t lost_count() const override {
    std::uint64_t lost = 0;
    for (const auto& consumer : consumers_)
      lost += consumer->counters().losses.total();
    return lost;
  }
  [[nodiscard]] EventRate push_bursts();

 private:
  rpc::Node consumer_node_{node_config(kBlock)};
  std::vector<std::unique_ptr<Noter>> handlers_{};
  std::vector<std::unique_ptr<events::Consumer>> consumers_{};
  rpc::Node supplier_node_{node_config(kBlock)};
  std::unique_ptr<events::Supplier> supplier_{};
  std::uint32_t type_ = 0;
};

// Pushes in bursts, each followed by a rest, so that real-time throttling takes no part of a burst.
EventRate HubSide::push_bursts() {
  constexpr int kBurstCount = 3;
  constexpr std::uint64_t kBurstSize = 100'000;
  const EventStamp stamp{};
  const auto payload = std::as_bytes(std::span<const EventStamp, 1>(&stamp, 1));
  const std::atomic<std::uint64_t>& count = handlers_[0]->count;
  EventRate rate;
  for (int burst = 0; burst < kBurstCount; ++burst) {
    const std::uint64_t before = count;
    const MonotonicTime begin = rt::now();
    for (std::uint64_t i = 0; i < kBurstSize; ++i) {
      // An event that finds the queue full counts as missing; the next one may find a slot.
      static_cast<void>(supplier_->add({.type = type_, .payload = payload, .origin = begin}));
    }
    static_cast<void>(supplier_->flush());
    MonotonicTime last = rt::now();
    std::uint64_t got = count - before;
    // Waits until all have arrived, or no more come.
    for (int quiet = 0; got < kBurstSize && quiet < 20; ++quiet) {
      rt::sleep_until(rt::now() + 1ms);
      const std::uint64_t now_got = count - before;
      if (now_got == got) continue;
      got = now_got;
      last = rt::now();
      quiet = 0;
    }
    const auto elapsed_ns = static_cast<double>((last - begin).count());
    rate.events_per_s = std::max(rate.events_per_s, static_cast<double>(got) * 1e9 / elapsed_ns);
    rate.missing_count += kBurstSize - got;
    rt::sleep_until(rt::now() + 300ms);
  }
  rate.lost_count = lost_count();
  return rate;
}

class ServedHub final : public EventHub {
 public:
  [[nodiscard]] std::string url() const override { return server->url(events::kHubPath); }

  std::unique_ptr<rpc::Node> link_node{};  ///< The node of a hub that takes another's events.
  std::unique_ptr<events::Hub> hub{};
  std::unique_ptr<rpc::Server> server{};
};

}  // namespace

expected<std::unique_ptr<EventHub>, std::string> open_event_hub(const EventSetting& setting) {
  events::HubConfig config;
  config.limits.subscription_count_max = kConsumerCountMax;
  config.quota = {.events_per_s = 1e8, .bytes_per_s = 1e11, .burst_s = 0.1};
  config.priority = kHighPriority;
  config.realtime = setting.realtime;
  if (setting.is_multicast) config.multicast = multicast_config();
  auto hub = events::Hub::create(config);
  if (!hub) return unexpected{hub.error().text()};
  auto server_config = events::server_config_for(config);
  server_config.realtime = setting.realtime;
  if (setting.network != nullptr) server_config.host = NetworkPair::kServerAddress;
  server_config.security.is_insecure = true;
  server_config.lanes = {{.name = "bench-hub",
                          .priority = kHighPriority,
                          .wait = setting.wait,
                          .cpus = {setting.has_own_hub ? setting.placement.client_cpu
                                                       : setting.placement.server_cpu}}};
  auto server = open_server(server_config, events::kHubPath, (*hub)->servant());
  if (!server) return unexpected{server.error()};
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
  auto served = std::make_unique<ServedHub>();
  served->hub = std::move(*hub);
  served->server = std::move(*server);
  if (!setting.linked_to.empty()) {
    served->link_node = std::make_unique<rpc::Node>(node_config(setting.wait));
    const auto linked =
        served->hub->link(*served->link_node, setting.linked_to,
                          {.priority = kHighPriority,
                           .cpus = {setting.placement.server_cpu},
                           .realtime = setting.realtime,
                           .transport = transport_of(setting.carrier),
                           .shared_ring = setting.carrier == Carrier::kSharedMemory});
    if (!linked) return unexpected{linked.error().text()};
  }
  return served;
}

expected<ServerProcess, std::string> start_between(const EventSetting& setting,
                                                   const ServerProcess::SetUp& set_up) {
  return ServerProcess::start([&]() -> expected<std::string, std::string> {
    if (setting.network != nullptr) {
      auto entered = setting.network->enter(NetworkPair::Host::kServer);
      if (!entered) return unexpected{entered.error()};
    }
    return set_up();
  });
}

expected<ServerProcess, std::string> start_event_hub(const EventSetting& setting) {
  return start_between(setting, [&]() -> expected<std::string, std::string> {
    auto hub = open_event_hub(setting);
    if (!hub) return unexpected{hub.error()};
    // The hub serves until the process ends.
    return hub->release()->url();
  });
}

expected<ServerProcess, std::string> start_idle_consumers(const EventSetting& setting,
                                                          const std::string& hub, int count) {
  return ServerProcess::start([&]() -> expected<std::string, std::string> {
    // The consumers live until the process ends.
    auto& side = *new HubSide;  // NOLINT(clang-analyzer-cplusplus.NewDeleteLeaks)
    auto added = side.add_consumers(setting, hub, count, 64, nullptr);
    if (!added) return unexpected{added.error()};
    return std::string("ready");
  });
}

expected<std::unique_ptr<EventSide>, std::string> connect_events(const EventSetting& setting,
                                                                 const std::string& hub,
                                                                 EventBoard& board) {
  auto side = std::make_unique<HubSide>();
  auto added = side->add_supplier(setting, setting.pushed_to.empty() ? hub : setting.pushed_to);
  if (added) added = side->add_consumers(setting, hub, setting.consumer_count, 64, &board);
  if (!added) return unexpected{added.error()};
  return side;
}

expected<EventRate, std::string> measure_event_rate(const EventSetting& setting,
                                                    const std::string& hub) {
  HubSide side;
  auto added = side.add_consumers(setting, hub, 1, 4096, nullptr);
  if (added) added = side.add_supplier(setting, hub);
  if (!added) return unexpected{added.error()};
  EventRate rate;
  // Below the consumer, which therefore takes all queued events before more are pushed.
  auto thread = rt::Thread::start({.name = "bench-supplier",
                                   .priority = kLowPriority,
                                   .cpus = {setting.placement.client_cpu},
                                   .realtime = setting.realtime},
                                  [&] { rate = side.push_bursts(); });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return rate;
}

}  // namespace rtpm::bench
