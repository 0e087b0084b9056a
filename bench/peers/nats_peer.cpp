#include <nats/nats.h>

#include <vector>

#include "peer.hpp"
#include "peer_port.hpp"
#include "rtpm/rt/clock.hpp"

// NATS, core publish and subscribe. Its C client's documentation: SetSendAsap has publications sent
// by the thread that publishes instead of a flusher's, where latency counts more than throughput.
// Each consumer is a connection of its own, whose messages come by its own thread. The server has
// no such settings; Go sees one CPU, as it is confined to one.
namespace rtpm::bench {
namespace {

constexpr const char* kSubject = "rtpm.bench";

std::string text_of(std::string_view what, natsStatus status) {
  return "NATS' " + std::string(what) + " failed: " + natsStatus_GetText(status);
}

expected<natsConnection*, std::string> connect(const std::string& address) {
  natsOptions* options = nullptr;
  natsConnection* connection = nullptr;
  natsOptions_Create(&options);
  natsOptions_SetURL(options, address.c_str());
  natsOptions_SetSendAsap(options, true);
  natsOptions_UseGlobalMessageDelivery(options, false);
  // One that is stopped between its turns cannot answer pings.
  natsOptions_SetPingInterval(options, 3'600'000);
  const natsStatus status = natsConnection_Connect(&connection, options);
  natsOptions_Destroy(options);
  if (status != NATS_OK) return unexpected{text_of("connect", status)};
  return connection;
}

struct Consumer {
  std::size_t number;
  EventBoard* board;
  natsConnection* connection;
  natsSubscription* subscription;
};

void note(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
  const auto& consumer = *static_cast<const Consumer*>(closure);
  consumer.board->note(consumer.number,
                       {reinterpret_cast<const std::byte*>(natsMsg_GetData(message)),
                        static_cast<std::size_t>(natsMsg_GetDataLength(message))},
                       rt::now());
  natsMsg_Destroy(message);
}

class NatsSide final : public PeerEventSide {
 public:
  // Its connections end with the process, which is as long as they are needed.
  [[nodiscard]] expected<void, std::string> begin(const std::string& address, int consumer_count,
                                                  EventBoard& board) {
    auto supplier = connect(address);
    if (!supplier) return unexpected{supplier.error()};
    supplier_ = *supplier;
    for (int i = 0; i < consumer_count; ++i) {
      auto connection = connect(address);
      if (!connection) return unexpected{connection.error()};
      auto& consumer = *consumers_.emplace_back(
          std::make_unique<Consumer>(Consumer{consumers_.size(), &board, *connection, nullptr}));
      const natsStatus status = natsConnection_Subscribe(
          &consumer.subscription, consumer.connection, kSubject, note, &consumer);
      if (status != NATS_OK) return unexpected{text_of("subscribe", status)};
      natsConnection_Flush(consumer.connection);
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    const natsStatus status =
        natsConnection_Publish(supplier_, kSubject, &stamp, static_cast<int>(sizeof stamp));
    if (status != NATS_OK) return unexpected{text_of("publish", status)};
    return {};
  }

 private:
  natsConnection* supplier_ = nullptr;
  std::vector<std::unique_ptr<Consumer>> consumers_{};
};

class NatsPeer final : public Peer {
 public:
  std::optional<BrokerProgram> broker_program(const PeerLane&) override {
    const std::uint16_t port = free_port();
    return BrokerProgram{
        .command = {RTPM_NATS_SERVER, "--addr", "127.0.0.1", "--port", std::to_string(port)},
        .address = "nats://127.0.0.1:" + std::to_string(port),
        .port = port};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string& address,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    return begin_side<NatsSide>(address, consumer_count, board);
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<NatsPeer>();
}

}  // namespace rtpm::bench
