#include <mosquitto.h>

#include <fstream>
#include <vector>

#include "peer.hpp"
#include "peer_port.hpp"
#include "rtpm/rt/clock.hpp"

// MQTT by Eclipse Mosquitto, with QoS 0, the quickest: no acknowledgements, nothing stored. As
// mosquitto.conf(5) and libmosquitto's documentation have it: set_tcp_nodelay on at both ends, no
// persistence, no log. Each consumer is a client of its own with a thread of its own. The supplier
// runs without a network thread, so that a publication is sent by the thread that publishes.
namespace rtpm::bench {
namespace {

constexpr const char* kTopic = "rtpm/bench";
/// Nothing may come in between: a client that is stopped between its turns cannot ping.
constexpr int kKeepAliveS = 65'535;

std::string text_of(std::string_view what, int error) {
  return "mosquitto's " + std::string(what) + " failed: " + mosquitto_strerror(error);
}

/// One client with its connection.
class Client {
 public:
  explicit Client(void* user) : client_(mosquitto_new(nullptr, true, user)) {
    mosquitto_int_option(client_, MOSQ_OPT_TCP_NODELAY, 1);
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { mosquitto_destroy(client_); }

  /// Connects, and waits for the broker's word.
  [[nodiscard]] expected<void, std::string> connect(const std::string& address) {
    // A path says that it is a socket's.
    const bool is_path = address.starts_with('/');
    const int error = mosquitto_connect(client_, is_path ? address.c_str() : "127.0.0.1",
                                        is_path ? 0 : std::stoi(address), kKeepAliveS);
    if (error != MOSQ_ERR_SUCCESS) return unexpected{text_of("connect", error)};
    if (const int lost = mosquitto_loop(client_, 1000, 1)) {
      return unexpected{text_of("connect", lost)};
    }
    return {};
  }
  [[nodiscard]] mosquitto* get() const noexcept { return client_; }

 private:
  mosquitto* client_;
};

struct Consumer {
  Consumer(std::size_t its_number, EventBoard& its_board)
      : number(its_number), board(&its_board), client(this) {
    mosquitto_message_callback_set(
        client.get(), [](mosquitto*, void* user, const mosquitto_message* message) {
          const auto& self = *static_cast<const Consumer*>(user);
          self.board->note(self.number,
                           {static_cast<const std::byte*>(message->payload),
                            static_cast<std::size_t>(message->payloadlen)},
                           rt::now());
        });
  }
  std::size_t number;
  EventBoard* board;
  Client client;
  rt::Thread thread{};
};

class MosquittoSide final : public PeerEventSide {
 public:
  [[nodiscard]] expected<void, std::string> begin(const std::string& address, int consumer_count,
                                                  EventBoard& board) {
    if (auto connected = supplier_.connect(address); !connected) return connected;
    for (int i = 0; i < consumer_count; ++i) {
      auto& consumer =
          *consumers_.emplace_back(std::make_unique<Consumer>(consumers_.size(), board));
      if (auto connected = consumer.client.connect(address); !connected) return connected;
      mosquitto_subscribe(consumer.client.get(), nullptr, kTopic, 0);
      auto thread = start_consumer([client = consumer.client.get()] {
        while (mosquitto_loop(client, -1, 1) == MOSQ_ERR_SUCCESS) {
        }
      });
      if (!thread) return unexpected{thread.error()};
      consumer.thread = std::move(*thread);
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    const int error =
        mosquitto_publish(supplier_.get(), nullptr, kTopic, sizeof stamp, &stamp, 0, false);
    if (error != MOSQ_ERR_SUCCESS) return unexpected{text_of("publish", error)};
    return {};
  }

 private:
  Client supplier_{nullptr};
  std::vector<std::unique_ptr<Consumer>> consumers_{};
};

class MosquittoPeer final : public Peer {
 public:
  std::optional<BrokerProgram> broker_program(const PeerLane& lane) override {
    const bool is_unix = lane.transport == "unix";
    const std::uint16_t port = is_unix ? std::uint16_t{0} : free_port();
    const std::string path = is_unix ? lane.socket_path() : std::string();
    const std::string configuration = lane.folder + "/mosquitto.conf";
    std::ofstream(configuration) << "listener " << port << " " << (is_unix ? path : "127.0.0.1")
                                 << "\nallow_anonymous true\npersistence false\n"
                                    "set_tcp_nodelay true\nlog_type none\nuser root\n";
    return BrokerProgram{.command = {RTPM_MOSQUITTO, "-c", configuration},
                         .address = is_unix ? path : std::to_string(port),
                         .port = port,
                         .path = path};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string& address,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    mosquitto_lib_init();
    return begin_side<MosquittoSide>(address, consumer_count, board);
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<MosquittoPeer>();
}

}  // namespace rtpm::bench
