#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "broker.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/node.hpp"
#include "topic.hpp"

namespace rtpm::mqtt {

/// Which way events go.
enum class Direction : std::uint8_t { kToBroker, kFromBroker, kBoth };

/// What crosses the bridge.
struct BridgeConfig {
  std::string hub{};
  std::string prefix = "rtpm";  ///< Of all topics of events.
  Direction direction = Direction::kBoth;
  std::vector<WantedOrigin> wanted{};  ///< What goes to the broker; empty: everything.
  std::vector<TopicMapping> mappings{};
  Priority priority{};    ///< Of events from the broker, and at which the hub sends to the bridge.
  std::uint8_t hops = 0;  ///< That events of brokers' own clients may go on from the hub.
  events::DeliveryPolicy delivery{.queue_capacity = events::kQueueCapacityMax};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  Duration deadline = std::chrono::seconds{1};
};

/// What became of events, beside BrokerCounters.
struct BridgeCounters {
  std::uint64_t to_broker_count = 0;  ///< Given to the broker's queue.
  std::uint64_t own_count = 0;        ///< Came back from hub or broker, and were left out.
  std::uint64_t pushed_count = 0;     ///< From the broker to the hub.
  std::uint64_t unknown_topic_count = 0;
  std::uint64_t hops_spent_count = 0;   ///< May go no further.
  std::uint64_t push_failed_count = 0;  ///< The hub is away, or they are too large for it.
};

/// Events of a hub as messages of a broker, and back. Crossing it is a hop, as over a link of hubs.
/// @ownership refers to its node
/// @threads  any
class Bridge final : private events::EventHandler, private Broker::Listener {
 public:
  /// @realtime set-up only; waits for the hub, not for the broker
  /// @errors   as events::Consumer, Supplier and Broker have them
  [[nodiscard]] static expected<std::unique_ptr<Bridge>, rpc::SetupError> create(
      rpc::Node& node, const BridgeConfig& config, BrokerConfig broker);
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;
  ~Bridge() override;

  [[nodiscard]] BridgeCounters counters() const noexcept;
  [[nodiscard]] const Broker& broker() const noexcept { return *broker_; }
  /// Counters of both in one line of words and numbers.
  [[nodiscard]] std::string report() const;

 private:
  explicit Bridge(BridgeConfig config) : config_(std::move(config)) {}
  [[nodiscard]] expected<void, rpc::SetupError> begin(rpc::Node& node, BrokerConfig broker);
  [[nodiscard]] events::Filter filter() const;
  void on_events(std::span<const events::EventView> events) override;
  void on_notice(const events::Notice& notice) override;
  void on_message(const Message& message) override;

  const BridgeConfig config_;
  const std::string id_ = make_id();
  std::unique_ptr<Broker> broker_{};
  std::unique_ptr<events::Supplier> supplier_{};
  std::unique_ptr<events::Consumer> consumer_{};
  std::atomic<std::uint32_t> own_tag_{0};  ///< Of the supplier's events in this life of the hub.

  std::atomic<std::uint64_t> to_broker_count_{0};
  std::atomic<std::uint64_t> own_count_{0};
  std::atomic<std::uint64_t> pushed_count_{0};
  std::atomic<std::uint64_t> unknown_topic_count_{0};
  std::atomic<std::uint64_t> hops_spent_count_{0};
  std::atomic<std::uint64_t> push_failed_count_{0};
};

}  // namespace rtpm::mqtt
