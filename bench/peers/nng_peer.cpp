#include <nng/nng.h>
#include <nng/protocol/pubsub0/pub.h>
#include <nng/protocol/pubsub0/sub.h>
#include <nng/protocol/reqrep0/rep.h>
#include <nng/protocol/reqrep0/req.h>

#include <array>

#include "peer.hpp"

// nng: REQ and REP sockets, used synchronously. TCP_NODELAY is its default. Its input and output
// run on a pool that a process has once, started by the first use of the library and so with the
// measured caller's priority; requests of either lane are answered by the lane's own thread. Events
// go through nng_device between two raw sockets, which is its own broker.
namespace rtpm::bench {
namespace {

auto failure(const char* what, int error) {
  return failure_of("nng", what, nng_strerror(error));
}

/// A socket that listens, and where.
struct Listener {
  nng_socket socket = NNG_SOCKET_INITIALIZER;
  std::string address{};
};

expected<std::string, std::string> listen(nng_socket socket, PeerLane lane, std::size_t index) {
  lane.index = index;
  const bool is_ipc = lane.transport == "ipc";
  const std::string end = is_ipc ? "ipc://" + lane.socket_path() : "tcp://127.0.0.1:0";
  nng_listener listener = NNG_LISTENER_INITIALIZER;
  if (const int error = nng_listen(socket, end.c_str(), &listener, 0))
    return failure("listen", error);
  if (is_ipc) return end;
  nng_sockaddr address{};
  if (const int error = nng_listener_get_addr(listener, NNG_OPT_LOCADDR, &address)) {
    return failure("address", error);
  }
  const std::uint16_t port = __builtin_bswap16(address.s_in.sa_port);
  return "tcp://127.0.0.1:" + std::to_string(port);
}

Outcome serve(const PeerLane& lane, const Announce& announce) {
  static std::array<Listener, kPeerLaneCount> listeners;
  // The first lane's thread opens both ends: while one is being opened, the library's own thread
  // looks at it without pause, and would keep a thread of low priority from going on.
  for (std::size_t index = 0; lane.index == 0 && index < kPeerLaneCount; ++index) {
    nng_rep0_open(&listeners[index].socket);
    auto address = listen(listeners[index].socket, lane, index);
    if (!address) return unexpected{address.error()};
    listeners[index].address = *address;
  }
  const auto& [socket, address] = listeners[lane.index];
  announce(address);
  PeerMessage message;
  int error = 0;
  for (std::size_t size = sizeof message; error == 0; size = sizeof message) {
    error = nng_recv(socket, &message, &size, 0);
    if (error != 0) break;
    answer(message.work_ns);
    error = nng_send(socket, &message, size, 0);
  }
  return failure("server", error);
}

expected<Exchange, std::string> connect(const PeerLane&, const std::string& address) {
  nng_socket socket = NNG_SOCKET_INITIALIZER;
  nng_req0_open(&socket);
  nng_socket_set_ms(socket, NNG_OPT_RECVTIMEO, 1000);
  nng_socket_set_ms(socket, NNG_OPT_SENDTIMEO, 1000);
  if (const int error = nng_dial(socket, address.c_str(), nullptr, 0)) {
    return failure("connect", error);
  }
  return [socket](const PeerMessage& request, PeerMessage& reply) -> Outcome {
    PeerMessage sent = request;
    if (const int error = nng_send(socket, &sent, sizeof sent, 0)) return failure("send", error);
    std::size_t size = sizeof reply;
    if (const int error = nng_recv(socket, &reply, &size, 0)) return failure("receive", error);
    return {};
  };
}

Outcome serve_events(const PeerLane& lane, const Announce& announce) {
  nng_socket in = NNG_SOCKET_INITIALIZER;
  nng_socket out = NNG_SOCKET_INITIALIZER;
  nng_sub0_open_raw(&in);
  nng_pub0_open_raw(&out);
  nng_socket_set_int(in, NNG_OPT_RECVBUF, kEventQueueMax);
  nng_socket_set_int(out, NNG_OPT_SENDBUF, kEventQueueMax);
  const auto in_address = listen(in, lane, 0);
  if (!in_address) return unexpected{in_address.error()};
  const auto out_address = listen(out, lane, 1);
  if (!out_address) return unexpected{out_address.error()};
  announce(*in_address + " " + *out_address);
  return failure("device", nng_device(in, out));
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string& address) {
  nng_socket socket = NNG_SOCKET_INITIALIZER;
  nng_pub0_open(&socket);
  nng_socket_set_int(socket, NNG_OPT_SENDBUF, kEventQueueMax);
  if (const int error = nng_dial(socket, address.c_str(), nullptr, 0)) {
    return failure("connect", error);
  }
  return [socket](const EventStamp& stamp) -> Outcome {
    EventStamp sent = stamp;
    if (const int error = nng_send(socket, &sent, sizeof sent, 0)) return failure("send", error);
    return {};
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string& address,
                                                Note& note) {
  nng_socket socket = NNG_SOCKET_INITIALIZER;
  nng_sub0_open(&socket);
  nng_socket_set_int(socket, NNG_OPT_RECVBUF, kEventQueueMax);
  nng_socket_set(socket, NNG_OPT_SUB_SUBSCRIBE, "", 0);
  if (const int error = nng_dial(socket, address.c_str(), nullptr, 0)) {
    return failure("connect", error);
  }
  return [socket, &note] {
    EventStamp stamp;
    for (std::size_t size = sizeof stamp; nng_recv(socket, &stamp, &size, 0) == 0;)
      note(&stamp, size);
  };
}

}  // namespace

const Peer kPeer{.serve = serve,
                 .connect = connect,
                 .connects_at_high_priority = true,  // As the two ends in serve().
                 .serve_events = serve_events,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
