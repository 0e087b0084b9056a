#include <unistd.h>

#include <atomic>
#include <vector>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/node.hpp"
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

// Consumers block, on both sides: many that spin on one CPU would starve each other.
constexpr rt::WaitConfig kBlock{.strategy = rt::WaitStrategy::kBlock};

constexpr std::uint32_t kType = 1;

rpc::NodeConfig node_config() {
  rpc::NodeConfig config;
  config.wait = kBlock;
  config.channel_count_max = kConsumerCountMax + 64;
  return config;
}

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
  [[nodiscard]] Outcome<> add_supplier(const EventSetting& setting, const std::string& hub) {
    auto supplier = events::Supplier::create(
        supplier_node_, hub,
        {.name = "bench",
         .priority = kHighPriority,
         .transport = setting.has_own_hub ? rpc::Transport::kLocal : transport_of(setting.carrier),
         .deadline = kSetUpPatience});
    if (!supplier) return failure(supplier.error());
    supplier_ = std::move(*supplier);
    return {};
  }

  /// `board` is null if no arrival is recorded.
  [[nodiscard]] Outcome<> add_consumers(const EventSetting& setting, const std::string& hub,
                                        int count, std::uint32_t capacity, EventBoard* board) {
    const events::ConsumerConfig config{.name = "bench",
                                        .filter = events::of_type(kType),
                                        .delivery = {.queue_capacity = capacity},
                                        .priority = kHighPriority,
                                        .cpus = {setting.placement.client_cpu},
                                        .realtime = setting.realtime,
                                        .transport = transport_of(setting.carrier),
                                        .shared_ring = setting.carrier == Carrier::kSharedMemory,
                                        .multicast = setting.is_multicast,
                                        .multicast_interface = kLoopback,
                                        .deadline = kSetUpPatience};
    for (int i = 0; i < count; ++i) {
      handlers_.push_back(std::make_unique<Noter>(board, handlers_.size()));
      auto consumer = events::Consumer::create(consumer_node_, hub, config, *handlers_.back());
      if (!consumer) return failure(consumer.error());
      consumers_.push_back(std::move(*consumer));
    }
    return {};
  }

  Outcome<> push(const EventStamp& stamp) override {
    return outcome(
        supplier_->push({.type = kType, .payload = std::as_bytes(std::span(&stamp, 1))}));
  }
  void set_slow(int count) override {
    const auto first = handlers_.size() - static_cast<std::size_t>(count);
    for (std::size_t i = 0; i < handlers_.size(); ++i)
      handlers_[i]->is_slow = i >= first;
  }
  [[nodiscard]] EventRate push_bursts();

 private:
  rpc::Node consumer_node_{node_config()};
  std::vector<std::unique_ptr<Noter>> handlers_{};
  std::vector<std::unique_ptr<events::Consumer>> consumers_{};
  rpc::Node supplier_node_{node_config()};
  std::unique_ptr<events::Supplier> supplier_{};
};

// Pushes in bursts, each followed by a rest, so that real-time throttling takes no part of a burst.
EventRate HubSide::push_bursts() {
  constexpr int kBurstCount = 3;
  constexpr std::uint64_t kBurstSize = 100'000;
  const EventStamp stamp{};
  const auto payload = std::as_bytes(std::span(&stamp, 1));
  const std::atomic<std::uint64_t>& count = handlers_[0]->count;
  EventRate rate;
  for (int burst = 0; burst < kBurstCount; ++burst) {
    const std::uint64_t before = count;
    const MonotonicTime begin = rt::now();
    for (std::uint64_t i = 0; i < kBurstSize; ++i) {
      // An event that finds the queue full counts as missing; the next one may find a slot.
      static_cast<void>(supplier_->add({.type = kType, .payload = payload, .origin = begin}));
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
  for (const auto& consumer : consumers_)
    rate.lost_count += consumer->counters().losses.total();
  return rate;
}

}  // namespace

Outcome<EventHub> open_event_hub(const EventSetting& setting) {
  events::HubConfig config;
  config.limits.subscription_count_max = kConsumerCountMax;
  config.quota = {.events_per_s = 1e8, .bytes_per_s = 1e11, .burst_s = 0.1};
  config.priority = kHighPriority;
  config.realtime = setting.realtime;
  if (setting.is_multicast) config.multicast = multicast_config();
  auto hub = events::Hub::create(config);
  if (!hub) return failure(hub.error());
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
  if (!server) return failure(server.error());
  if (auto started = (*server)->start(); !started) return failure(started.error());
  return EventHub{std::move(*hub), std::move(*server)};
}

std::string EventHub::url() const {
  return server->url(events::kHubPath);
}

Outcome<ServerProcess> start_between(const EventSetting& setting,
                                     const ServerProcess::SetUp& set_up) {
  return ServerProcess::start([&]() -> Outcome<std::string> {
    if (setting.network != nullptr) {
      auto entered = setting.network->enter(NetworkPair::Host::kServer);
      if (!entered) return failure(entered.error());
    }
    return set_up();
  });
}

Outcome<ServerProcess> start_event_hub(const EventSetting& setting) {
  return start_between(setting, [&]() -> Outcome<std::string> {
    auto hub = open_event_hub(setting);
    if (!hub) return failure(hub.error());
    // The hub serves until the process ends.
    return (new EventHub(std::move(*hub)))->url();
  });
}

Outcome<ServerProcess> start_idle_consumers(const EventSetting& setting, const std::string& hub,
                                            int count) {
  return ServerProcess::start([&]() -> Outcome<std::string> {
    // The consumers live until the process ends.
    auto& side = *new HubSide;  // NOLINT(clang-analyzer-cplusplus.NewDeleteLeaks)
    auto added = side.add_consumers(setting, hub, count, 64, nullptr);
    if (!added) return failure(added.error());
    return std::string("ready");
  });
}

Outcome<std::unique_ptr<EventSide>> connect_events(const EventSetting& setting,
                                                   const std::string& hub, EventBoard& board) {
  auto side = std::make_unique<HubSide>();
  auto added = side->add_supplier(setting, hub);
  if (added) added = side->add_consumers(setting, hub, setting.consumer_count, 64, &board);
  if (!added) return failure(added.error());
  return side;
}

Outcome<EventRate> measure_event_rate(const EventSetting& setting, const std::string& hub) {
  HubSide side;
  auto added = side.add_consumers(setting, hub, 1, 4096, nullptr);
  if (added) added = side.add_supplier(setting, hub);
  if (!added) return failure(added.error());
  EventRate rate;
  // Below the consumer, which therefore takes all queued events before more are pushed.
  auto thread = rt::Thread::start({.name = "bench-supplier",
                                   .priority = kLowPriority,
                                   .cpus = {setting.placement.client_cpu},
                                   .realtime = setting.realtime},
                                  [&] { rate = side.push_bursts(); });
  if (!thread) return failure(thread.error());
  thread->join();
  return rate;
}

}  // namespace rtpm::bench
