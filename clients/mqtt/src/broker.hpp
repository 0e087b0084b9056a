#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/wait_set.hpp"

struct mosquitto;

/// The bridge's connection to a broker.
namespace rtpm::mqtt {

/// Configures the connection.
struct BrokerConfig {
  /// Marks the bridge's messages and names the client at the broker; must be unique. If empty,
  /// random.
  std::string id{};
  std::string host = "127.0.0.1";
  std::uint16_t port = 1883;
  std::string user{};      ///< Empty for none.
  std::string password{};  ///< Password of `user`.
  std::string ca_file{};   ///< Trusted certificates; if empty, no TLS.
  std::vector<std::string> subscriptions{};
  std::uint32_t queue_capacity = 1024;  ///< In messages.
  bool retains = false;                 ///< The broker keeps the last message of each topic.
  Duration retry_max = std::chrono::seconds{2};
};

/// A message. `id` (the publishing bridge), `hops` (how many more bridges or links it may cross)
/// and `schema_id` are user properties of MQTT 5, which messages from other clients lack.
struct Message {
  std::string topic{};
  std::vector<std::byte> payload{};
  std::string id{};
  std::uint64_t schema_id = 0;
  std::uint8_t hops = 0;
};

/// Counters of messages.
struct BrokerCounters {
  std::uint64_t published_count = 0;
  std::uint64_t overflow_count = 0;  ///< Messages dropped from the full queue.
  std::uint64_t refused_count = 0;   ///< Messages that libmosquitto refused as too large.
  std::uint64_t received_count = 0;
  std::uint64_t connection_count = 0;
};

/// Creates a random, unique name.
[[nodiscard]] std::string make_id();

/// A connection to an MQTT 5 broker with a bounded queue. The time-shared thread "rtpm-mqtt"
/// reconnects it. It does not receive its own messages.
/// @threads  any
class Broker {
 public:
  /// Receives messages on the thread "rtpm-mqtt".
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void on_message(const Message& message) = 0;
  };
  /// @realtime set-up only; does not wait for the broker
  /// @errors   unreadable certificates; no memory
  [[nodiscard]] static expected<std::unique_ptr<Broker>, SetupError> create(BrokerConfig config,
                                                                            Listener& listener);
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;
  ~Broker();

  /// Queues a message. Never waits for the broker.
  void publish(const std::string& topic, ConstBytes payload, std::uint64_t schema_id,
               std::uint8_t hops);
  [[nodiscard]] BrokerCounters counters() const;
  /// Whether the bridge is connected to the broker and subscribed.
  [[nodiscard]] bool is_connected() const noexcept { return is_connected_; }
  /// Why it is not connected; empty if it is.
  [[nodiscard]] std::string reason() const;
  /// See BrokerConfig::id.
  [[nodiscard]] const std::string& id() const noexcept { return id_; }

  class Callbacks;

 private:
  struct Free {
    void operator()(mosquitto* client) const noexcept;
  };
  Broker(BrokerConfig config, Listener& listener, std::unique_ptr<transport::WaitSet> wait_set);
  [[nodiscard]] expected<void, SetupError> begin();
  void run();
  [[nodiscard]] bool connect();
  void talk();
  void publish_waiting();
  void note_connected();
  void set_reason(std::string reason);

  const BrokerConfig config_;
  Listener& listener_;
  const std::string id_;
  std::unique_ptr<transport::WaitSet> wait_set_;
  int socket_ = -1;  ///< Registered in wait_set_ while connected.
  std::unique_ptr<mosquitto, Free> client_{};

  std::size_t missing_count_ = 0;  ///< Subscriptions that the broker has not granted yet.

  mutable rt::PiMutex mutex_;  ///< Guards the members below.
  std::vector<Message> queue_;
  std::size_t queue_begin_ = 0;
  std::size_t queue_size_ = 0;
  BrokerCounters counters_{};
  std::string reason_{"it is being connected"};
  std::atomic<bool> is_connected_{false};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::mqtt
