#include <mosquitto.h>

#include <fstream>

#include "peer.hpp"

// MQTT by Eclipse Mosquitto, with QoS 0, the quickest: no acknowledgements, nothing stored. Tuned
// as mosquitto.conf(5) and libmosquitto's documentation recommend: set_tcp_nodelay on at both ends,
// no persistence, no log. Each consumer is a client of its own with a thread of its own. The
// supplier runs without a network thread, so that a publication is sent by the publishing thread.
namespace rtpm::bench {
namespace {

constexpr const char* kTopic = "rtpm/bench";
/// The longest there can be: a client that is stopped between its turns cannot ping.
constexpr int kKeepAliveS = 65'535;

auto failure(const char* what, int error) {
  return failure_of("mosquitto", what, mosquitto_strerror(error));
}

BrokerProgram broker_program(const PeerLane& lane) {
  const bool is_unix = lane.transport == "unix";
  const std::uint16_t port = is_unix ? std::uint16_t{0} : free_port();
  const std::string path = is_unix ? lane.socket_path() : std::string();
  const std::string configuration = lane.folder + "/mosquitto.conf";
  std::ofstream(configuration) << "listener " << port << " " << (is_unix ? path : "127.0.0.1")
                               << "\nallow_anonymous true\npersistence false\n"
                                  "set_tcp_nodelay true\nlog_type none\nuser root\n";
  return {.command = {RTPM_BROKER, "-c", configuration},
          .address = is_unix ? path : std::to_string(port),
          .port = port,
          .path = path};
}

/// Connects a client, and returns it when the broker has confirmed it.
expected<mosquitto*, std::string> connect(const std::string& address, Note* note) {
  mosquitto_lib_init();
  mosquitto* const client = mosquitto_new(nullptr, true, note);
  mosquitto_int_option(client, MOSQ_OPT_TCP_NODELAY, 1);
  mosquitto_message_callback_set(client, [](mosquitto*, void* user, const mosquitto_message* got) {
    (*static_cast<const Note*>(user))(got->payload, static_cast<std::size_t>(got->payloadlen));
  });
  // An address that is a path belongs to a socket.
  const bool is_path = address.starts_with('/');
  int error = mosquitto_connect(client, is_path ? address.c_str() : "127.0.0.1",
                                is_path ? 0 : std::stoi(address), kKeepAliveS);
  if (error == MOSQ_ERR_SUCCESS) error = mosquitto_loop(client, 1000, 1);
  if (error != MOSQ_ERR_SUCCESS) return failure("connect", error);
  return client;
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string& address) {
  const auto client = connect(address, nullptr);
  if (!client) return unexpected{client.error()};
  return [supplier = *client](const EventStamp& stamp) -> Outcome {
    const int error = mosquitto_publish(supplier, nullptr, kTopic, sizeof stamp, &stamp, 0, false);
    if (error != MOSQ_ERR_SUCCESS) return failure("publish", error);
    return {};
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string& address,
                                                Note& note) {
  const auto client = connect(address, &note);
  if (!client) return unexpected{client.error()};
  mosquitto_subscribe(*client, nullptr, kTopic, 0);
  return [consumer = *client] {
    while (mosquitto_loop(consumer, -1, 1) == MOSQ_ERR_SUCCESS) {
    }
  };
}

}  // namespace

const Peer kPeer{.broker_program = broker_program,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
