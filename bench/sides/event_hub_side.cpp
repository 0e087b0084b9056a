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

// Consumers block, on both sides: many that spin on one CPU would only keep each other from it.
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

/// Consumers of one node, each with its handler.
struct Consumers {
  explicit Consumers(const rt::WaitConfig& wait) : node(node_config(wait)) {}
  [[nodiscard]] expected<void, std::string> add(const EventSetting& setting, const std::string& hub,
                                                EventBoard* board, std::uint32_t capacity) {
    handlers.push_back(std::make_unique<Noter>(board, handlers.size()));
    auto consumer = events::Consumer::create(
        node, hub,
        {.name = "bench",
         .filter = events::of_type(setting.type),
         .delivery = {.queue_capacity = capacity},
         .priority = kHighPriority,
         .cpus = {setting.placement.client_cpu},
         .realtime = setting.realtime,
         .transport = consumer_transport_of(setting),
         .shared_ring = !setting.is_embedded && setting.carrier == Carrier::kSharedMemory,
         .has_own_thread = setting.has_own_threads,
         .multicast = setting.is_multicast,
         .multicast_interface = kLoopback,
         .deadline = kSetUpPatience},
        *handlers.back());
    if (!consumer) return unexpected{consumer.error().text()};
    consumers.push_back(std::move(*consumer));
    return {};
  }
  rpc::Node node;
  std::vector<std::unique_ptr<Noter>> handlers{};
  std::vector<std::unique_ptr<events::Consumer>> consumers{};
};

class HubSide final : public EventSide {
 public:
  HubSide() : consumers_(kBlock), node_(node_config(kBlock)) {}

  [[nodiscard]] expected<void, std::string> begin(const EventSetting& setting,
                                                  const std::string& hub, EventBoard& board) {
    const std::string& supplier_hub = setting.pushed_to.empty() ? hub : setting.pushed_to;
    auto supplier = events::Supplier::create(node_, supplier_hub,
                                             {.name = "bench",
                                              .priority = kHighPriority,
                                              .transport = supplier_transport_of(setting),
                                              .deadline = kSetUpPatience});
    if (!supplier) return unexpected{supplier.error().text()};
    supplier_ = std::move(*supplier);
    type_ = setting.type;
    for (int i = 0; i < setting.consumer_count; ++i) {
      if (auto added = consumers_.add(setting, hub, &board, 64); !added) return added;
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
    const auto first = consumers_.handlers.size() - static_cast<std::size_t>(count);
    for (std::size_t i = 0; i < consumers_.handlers.size(); ++i)
      consumers_.handlers[i]->is_slow = i >= first;
  }
  std::uint64_t lost_count() const override {
    std::uint64_t lost = 0;
    for (const auto& consumer : consumers_.consumers)
      lost += consumer->counters().losses.total();
    return lost;
  }

 private:
  Consumers consumers_;
  rpc::Node node_;
  std::unique_ptr<events::Supplier> supplier_{};
  std::uint32_t type_ = 0;
};

// Bursts with a rest behind each, so that real-time throttling takes no part of it.
EventRate push_bursts(events::Supplier& supplier, std::uint32_t type,
                      const events::Consumer& consumer, const Noter& noter) {
  constexpr int kBurstCount = 3;
  constexpr std::uint64_t kBurstSize = 100'000;
  const EventStamp stamp{};
  const auto payload = std::as_bytes(std::span<const EventStamp, 1>(&stamp, 1));
  EventRate rate;
  for (int burst = 0; burst < kBurstCount; ++burst) {
    const std::uint64_t before = noter.count;
    const MonotonicTime begin = rt::now();
    for (std::uint64_t i = 0; i < kBurstSize; ++i) {
      // What does not go for want of room is missing in the end, and the next may go.
      static_cast<void>(supplier.add({.type = type, .payload = payload, .origin = begin}));
    }
    static_cast<void>(supplier.flush());
    MonotonicTime last = rt::now();
    std::uint64_t got = noter.count - before;
    // Until all are there, or no more come.
    for (int quiet = 0; got < kBurstSize && quiet < 20; ++quiet) {
      rt::sleep_until(rt::now() + 1ms);
      const std::uint64_t now_got = noter.count - before;
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
  rate.lost_count = consumer.counters().losses.total();
  return rate;
}

class ServedHub final : public EventHub {
 public:
  [[nodiscard]] std::string url() const override { return server->url(events::kHubPath); }

  std::unique_ptr<rpc::Node> link_node{};  ///< Of a hub that takes events of another.
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
  server_config.lanes = {{.name = "bench-hub",
                          .priority = kHighPriority,
                          .wait = setting.wait,
                          .cpus = {setting.has_own_hub ? setting.placement.client_cpu
                                                       : setting.placement.server_cpu}}};
  auto server = rpc::Server::create(server_config);
  if (!server) return unexpected{server.error().text()};
  if (auto added = (*server)->add(events::kHubPath, (*hub)->servant()); !added) {
    return unexpected{added.error().text()};
  }
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
  return std::unique_ptr<EventHub>(std::move(served));
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
    // It serves until the process ends.
    return hub->release()->url();
  });
}

expected<ServerProcess, std::string> start_idle_consumers(const EventSetting& setting,
                                                          const std::string& hub, int count) {
  return ServerProcess::start([setting, hub, count]() -> expected<std::string, std::string> {
    auto consumers = std::make_unique<Consumers>(kBlock);
    for (int i = 0; i < count; ++i) {
      if (auto added = consumers->add(setting, hub, nullptr, 64); !added) {
        return unexpected{added.error()};
      }
    }
    // They live until the process ends.
    static_cast<void>(consumers.release());
    return std::string("ready");  // NOLINT(clang-analyzer-cplusplus.NewDeleteLeaks)
  });
}

expected<std::unique_ptr<EventSide>, std::string> connect_events(const EventSetting& setting,
                                                                 const std::string& hub,
                                                                 EventBoard& board) {
  auto side = std::make_unique<HubSide>();
  if (auto begun = side->begin(setting, hub, board); !begun) return unexpected{begun.error()};
  return std::unique_ptr<EventSide>(std::move(side));
}

expected<EventRate, std::string> measure_event_rate(const EventSetting& setting,
                                                    const std::string& hub) {
  Consumers consumers(kBlock);
  if (auto added = consumers.add(setting, hub, nullptr, 4096); !added) {
    return unexpected{added.error()};
  }
  rpc::Node node(node_config(kBlock));
  auto supplier = events::Supplier::create(node, hub,
                                           {.priority = kHighPriority,
                                            .transport = transport_of(setting.carrier),
                                            .deadline = kSetUpPatience});
  if (!supplier) return unexpected{supplier.error().text()};
  expected<EventRate, std::string> outcome;
  // Below the consumer, which so takes what is there before more is pushed.
  auto thread =
      rt::Thread::start({.name = "bench-supplier",
                         .priority = kLowPriority,
                         .cpus = {setting.placement.client_cpu},
                         .realtime = setting.realtime},
                        [&] {
                          outcome = push_bursts(**supplier, setting.type, *consumers.consumers[0],
                                                *consumers.handlers[0]);
                        });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return outcome;
}

}  // namespace rtpm::bench
