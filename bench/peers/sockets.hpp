#pragma once

#include "peer.hpp"

/// Calls and events by libraries of messaging sockets: request and reply, publish and subscribe.
namespace rtpm::bench {

enum class SocketKind : std::uint8_t {
  kReply,
  kRequest,
  kPublish,
  kSubscribe,
  kFromPublishers,
  kToSubscribers
};

/// A listening socket, and its address.
template <class Socket>
struct Listener {
  Socket socket{};
  std::string address{};
};

/// The whole of such a peer. `Library` provides:
///   Socket                      can be copied
///   listen(kind, lane, name)    expected<Listener<Socket>>; the last two kinds are a broker's
///   listen_for_calls(lane)      like listen(), of the kind kReply
///   dial(kind, address)         expected<Socket>; of kRequest, operations give up after a second
///   send(socket, bytes, size), receive(socket, bytes, size)   bool
///   forward(in, out)            is the broker, without end
///   failure(what)               why this thread's last operation failed
template <class Library>
struct SocketPeer {
  using Socket = typename Library::Socket;

  static Outcome<> serve(const PeerLane& lane, const Announce& announce) {
    const auto listener = Library::listen_for_calls(lane);
    if (!listener) return failure(listener.error());
    announce(listener->address);
    const Socket socket = listener->socket;
    PeerMessage message;
    while (Library::receive(socket, &message, sizeof message)) {
      answer(message.work_ns);
      if (!Library::send(socket, &message, sizeof message)) break;
    }
    return Library::failure("server");
  }

  static Outcome<Exchange> connect(const PeerLane&, const std::string& address) {
    const auto dialled = Library::dial(SocketKind::kRequest, address);
    if (!dialled) return failure(dialled.error());
    return [socket = *dialled](const PeerMessage& request, PeerMessage& reply) -> Outcome<> {
      if (!Library::send(socket, &request, sizeof request)) return Library::failure("send");
      if (!Library::receive(socket, &reply, sizeof reply)) return Library::failure("receive");
      return {};
    };
  }

  static Outcome<> serve_events(const PeerLane& lane, const Announce& announce) {
    const auto in = Library::listen(SocketKind::kFromPublishers, lane, "in");
    if (!in) return failure(in.error());
    const auto out = Library::listen(SocketKind::kToSubscribers, lane, "out");
    if (!out) return failure(out.error());
    announce(in->address + " " + out->address);
    Library::forward(in->socket, out->socket);
    return Library::failure("broker");
  }

  static Outcome<Push> connect_supplier(const PeerLane&, const std::string& address) {
    const auto dialled = Library::dial(SocketKind::kPublish, address);
    if (!dialled) return failure(dialled.error());
    return [socket = *dialled](const EventStamp& stamp) -> Outcome<> {
      if (!Library::send(socket, &stamp, sizeof stamp)) return Library::failure("send");
      return {};
    };
  }

  static Outcome<Consume> connect_consumer(const PeerLane&, const std::string& address,
                                           Note& note) {
    const auto dialled = Library::dial(SocketKind::kSubscribe, address);
    if (!dialled) return failure(dialled.error());
    return [socket = *dialled, &note] {
      EventStamp stamp;
      while (Library::receive(socket, &stamp, sizeof stamp))
        note(&stamp, sizeof stamp);
    };
  }

  static constexpr Peer kFunctions{.serve = serve,
                                   .connect = connect,
                                   .connects_at_high_priority = Library::kConnectsAtHighPriority,
                                   .serve_events = serve_events,
                                   .connect_supplier = connect_supplier,
                                   .connect_consumer = connect_consumer};
};

}  // namespace rtpm::bench
