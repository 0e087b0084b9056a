#include <nats/nats.h>

#include "peer.hpp"

// NATS, core publish and subscribe. Its C client's documentation: SetSendAsap lets the
// thread that publishes send, instead of a flusher's, where latency counts more than throughput.
// Each consumer is a connection of its own, whose messages come by its own thread. The server has
// no such settings; Go sees one CPU, as it is confined to one.
namespace rtpm::bench {
namespace {

constexpr const char* kSubject = "rtpm.bench";

auto failure(const char* what, natsStatus status) {
  return failure_of("NATS", what, natsStatus_GetText(status));
}

BrokerProgram broker_program(const PeerLane&) {
  const std::uint16_t port = free_port();
  return {.command = {RTPM_BROKER, "--addr", "127.0.0.1", "--port", std::to_string(port)},
          .address = "nats://127.0.0.1:" + std::to_string(port),
          .port = port};
}

expected<natsConnection*, std::string> connect(const std::string& address) {
  natsOptions* options = nullptr;
  natsConnection* connection = nullptr;
  natsOptions_Create(&options);
  natsOptions_SetURL(options, address.c_str());
  natsOptions_SetSendAsap(options, true);
  natsOptions_UseGlobalMessageDelivery(options, false);
  // A connection that is stopped between its turns cannot answer pings.
  natsOptions_SetPingInterval(options, 3'600'000);
  const natsStatus status = natsConnection_Connect(&connection, options);
  natsOptions_Destroy(options);
  if (status != NATS_OK) return failure("connect", status);
  return connection;
}

void take(natsConnection*, natsSubscription*, natsMsg* message, void* note) {
  (*static_cast<const Note*>(note))(natsMsg_GetData(message),
                                    static_cast<std::size_t>(natsMsg_GetDataLength(message)));
  natsMsg_Destroy(message);
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string& address) {
  const auto connection = connect(address);
  if (!connection) return unexpected{connection.error()};
  return [supplier = *connection](const EventStamp& stamp) -> Outcome {
    const natsStatus status = natsConnection_Publish(supplier, kSubject, &stamp, sizeof stamp);
    if (status != NATS_OK) return failure("publish", status);
    return {};
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string& address,
                                                Note& note) {
  const auto connection = connect(address);
  if (!connection) return unexpected{connection.error()};
  natsSubscription* subscription = nullptr;
  const natsStatus status =
      natsConnection_Subscribe(&subscription, *connection, kSubject, take, &note);
  if (status != NATS_OK) return failure("subscribe", status);
  natsConnection_Flush(*connection);
  return Consume();
}

}  // namespace

const Peer kPeer{.broker_program = broker_program,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
