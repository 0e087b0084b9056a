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
#include "rtpm/base/expected.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/polled_wait_set.hpp"

struct mosquitto;

/// A broker as the bridge sees it.
namespace rtpm::mqtt {

/// Where the broker is and how it is talked to.
struct BrokerConfig {
  /// What its messages are marked with, and its name at the broker: another for each client. Empty:
  /// a new one.
  std::string id{};
  std::string host = "127.0.0.1";
  std::uint16_t port = 1883;
  std::string user{};      ///< Empty: none.
  std::string password{};  ///< Of the user.
  std::string ca_file{};   ///< Certificates that are trusted; empty: no TLS.
  std::vector<std::string> subscriptions{};
  std::uint32_t queue_capacity = 1024;  ///< Messages that wait for the broker at most.
  bool retains = false;                 ///< The broker keeps the last message of each topic.
  Duration retry_max = std::chrono::seconds{2};
};

/// A message. `id` tells which bridge published it, `hops` how many further bridges or links it may
/// cross, `schema_id` whose payload it is: user properties of MQTT 5, all absent in the messages of
/// others.
struct Message {
  std::string topic{};
  std::vector<std::byte> payload{};
  std::string id{};
  std::uint64_t schema_id = 0;
  std::uint8_t hops = 0;
};

/// What became of messages.
struct BrokerCounters {
  std::uint64_t published_count = 0;
  std::uint64_t overflow_count = 0;  ///< The oldest made room: the broker is away, or too slow.
  std::uint64_t refused_count = 0;   ///< By libmosquitto: too large for the broker.
  std::uint64_t received_count = 0;
  std::uint64_t connection_count = 0;
};

/// A name that no other client has.
[[nodiscard]] std::string make_id();

/// A connection to an MQTT 5 broker that is made again by itself, with a bounded queue before it,
/// all kept by one time-shared thread "rtpm-mqtt". What it published itself does not come back.
/// @threads  any
class Broker {
 public:
  /// Takes messages; called from the broker's thread.
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void on_message(const Message& message) = 0;
  };
  /// @realtime set-up only; does not wait for the broker
  /// @errors   a file of certificates that can't be read, no memory
  [[nodiscard]] static expected<std::unique_ptr<Broker>, rpc::SetupError> create(
      BrokerConfig config, Listener& listener);
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;
  ~Broker();

  /// Queues a message. Never waits for the broker.
  void publish(const std::string& topic, ConstBytes payload, std::uint64_t schema_id,
               std::uint8_t hops);
  [[nodiscard]] BrokerCounters counters() const;
  /// Connected, and subscribed.
  [[nodiscard]] bool is_connected() const noexcept { return is_connected_; }
  /// Why it is not connected; empty: it is.
  [[nodiscard]] std::string reason() const;
  /// What the messages are marked with.
  [[nodiscard]] const std::string& id() const noexcept { return id_; }

  class Callbacks;

 private:
  struct Free {
    void operator()(mosquitto* client) const noexcept;
  };
  Broker(BrokerConfig config, Listener& listener, std::unique_ptr<transport::WaitSet> wait_set);
  [[nodiscard]] expected<void, rpc::SetupError> begin();
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
  int socket_ = -1;  ///< In wait_set_ while connected.
  std::unique_ptr<mosquitto, Free> client_{};

  std::size_t missing_count_ = 0;  ///< Subscriptions that the broker has not granted yet.

  mutable rt::PiMutex mutex_;  ///< Of what follows.
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
