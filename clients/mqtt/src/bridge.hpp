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

/// The direction in which events pass.
enum class Direction : std::uint8_t { kToBroker, kFromBroker, kBoth };

/// Configures a bridge.
struct BridgeConfig {
  std::string hub{};
  std::string prefix = "rtpm";  ///< The first part of all topics.
  Direction direction = Direction::kBoth;
  std::vector<WantedOrigin> wanted{};  ///< The events published to the broker; all if empty.
  std::vector<TopicMapping> mappings{};
  /// The priority of events from the broker, and of the hub's sends to the bridge.
  Priority priority{};
  std::uint8_t hops = 0;  ///< How many more hops events from the broker's other clients may take.
  events::DeliveryPolicy delivery{.queue_capacity = events::kQueueCapacityMax};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  Duration deadline = std::chrono::seconds{1};
};

/// Counters of a bridge, besides BrokerCounters.
struct BridgeCounters {
  std::uint64_t to_broker_count = 0;  ///< Events queued for the broker.
  std::uint64_t own_count = 0;  ///< Own events that came back from hub or broker, and were dropped.
  std::uint64_t pushed_count = 0;  ///< Events from the broker to the hub.
  std::uint64_t unknown_topic_count = 0;
  std::uint64_t hops_spent_count = 0;   ///< Events dropped because no hops were left.
  std::uint64_t push_failed_count = 0;  ///< Failures: hub unreachable, or event too large.
};

/// Passes events of a hub to a broker, and messages of the broker to the hub. Counts as a hop, like
/// a link between hubs.
/// @ownership refers to its node
/// @threads  any
class Bridge final : private events::EventHandler, private Broker::Listener {
 public:
  /// @realtime set-up only; waits for the hub, not for the broker
  /// @errors   those of events::Consumer, Supplier and Broker
  [[nodiscard]] static expected<std::unique_ptr<Bridge>, SetupError> create(
      rpc::Node& node, const BridgeConfig& config, BrokerConfig broker);
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;
  ~Bridge() override;

  [[nodiscard]] BridgeCounters counters() const noexcept;
  [[nodiscard]] const Broker& broker() const noexcept { return *broker_; }
  /// The counters of bridge and broker in one line of text.
  [[nodiscard]] std::string report() const;

 private:
  explicit Bridge(BridgeConfig config) : config_(std::move(config)) {}
  [[nodiscard]] expected<void, SetupError> begin(rpc::Node& node, BrokerConfig broker);
  [[nodiscard]] events::Filter filter() const;
  void on_events(std::span<const events::EventView> events) override;
  void on_notice(const events::Notice& notice) override;
  void on_message(const Message& message) override;

  const BridgeConfig config_;
  const std::string id_ = make_id();
  std::unique_ptr<Broker> broker_{};
  std::unique_ptr<events::Supplier> supplier_{};
  std::unique_ptr<events::Consumer> consumer_{};
  /// The supplier_tag of the bridge's own supplier at this hub.
  std::atomic<std::uint32_t> own_tag_{0};

  std::atomic<std::uint64_t> to_broker_count_{0};
  std::atomic<std::uint64_t> own_count_{0};
  std::atomic<std::uint64_t> pushed_count_{0};
  std::atomic<std::uint64_t> unknown_topic_count_{0};
  std::atomic<std::uint64_t> hops_spent_count_{0};
  std::atomic<std::uint64_t> push_failed_count_{0};
};

}  // namespace rtpm::mqtt
