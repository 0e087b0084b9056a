#include <zmq.h>

#include <array>
#include <string_view>

#include "peer.hpp"

// ZeroMQ: REQ and REP sockets, which are its calls. Tuning, as the guide and zmq_setsockopt(3) have
// it: nothing is batched on the wire (ZeroMQ sets TCP_NODELAY by itself), one I/O thread per
// context, and no lingering. Each lane has a context of its own, so that its I/O thread has the
// lane's priority: a context's threads are started by its first socket, and inherit. Events go
// through zmq_proxy between XSUB and XPUB, which is the guide's own broker. Supplier and consumers
// share a context and so its I/O thread, which has one CPU with them.
namespace rtpm::bench {
namespace {

auto failure(const char* what) {
  return failure_of("ZeroMQ", what, zmq_strerror(zmq_errno()));
}

void set_option(void* socket, int option, int value) {
  zmq_setsockopt(socket, option, &value, sizeof value);
}

void* open_socket(void* context, int type) {
  void* const socket = zmq_socket(context, type);
  set_option(socket, ZMQ_LINGER, 0);
  return socket;
}

/// Binds a socket to an end of the lane.
/// @return where it is reached
expected<std::string, std::string> bind(void* socket, const PeerLane& lane, const char* name) {
  const std::string wanted = lane.transport == "ipc" ? "ipc://" + lane.socket_path() + name
                                                     : std::string("tcp://127.0.0.1:*");
  if (zmq_bind(socket, wanted.c_str()) != 0) return failure("bind");
  std::array<char, 256> address{};
  std::size_t size = address.size();
  zmq_getsockopt(socket, ZMQ_LAST_ENDPOINT, address.data(), &size);
  return std::string(address.data());
}

Outcome serve(const PeerLane& lane, const Announce& announce) {
  void* const socket = open_socket(zmq_ctx_new(), ZMQ_REP);
  const auto address = bind(socket, lane, "calls");
  if (!address) return unexpected{address.error()};
  announce(*address);
  PeerMessage message;
  while (zmq_recv(socket, &message, sizeof message, 0) == sizeof message) {
    answer(message.work_ns);
    if (zmq_send(socket, &message, sizeof message, 0) < 0) break;
  }
  return failure("server");
}

expected<Exchange, std::string> connect(const PeerLane&, const std::string& address) {
  void* const socket = open_socket(zmq_ctx_new(), ZMQ_REQ);
  set_option(socket, ZMQ_RCVTIMEO, 1000);
  set_option(socket, ZMQ_SNDTIMEO, 1000);
  if (zmq_connect(socket, address.c_str()) != 0) return failure("connect");
  return [socket](const PeerMessage& request, PeerMessage& reply) -> Outcome {
    if (zmq_send(socket, &request, sizeof request, 0) < 0) return failure("send");
    if (zmq_recv(socket, &reply, sizeof reply, 0) != sizeof reply) return failure("receive");
    return {};
  };
}

Outcome serve_events(const PeerLane& lane, const Announce& announce) {
  void* const context = zmq_ctx_new();
  void* const in = open_socket(context, ZMQ_XSUB);
  void* const out = open_socket(context, ZMQ_XPUB);
  const auto in_address = bind(in, lane, "in");
  if (!in_address) return unexpected{in_address.error()};
  const auto out_address = bind(out, lane, "out");
  if (!out_address) return unexpected{out_address.error()};
  announce(*in_address + " " + *out_address);
  zmq_proxy(in, out, nullptr);
  return failure("proxy");
}

void* event_context() {
  static void* const kContext = zmq_ctx_new();
  return kContext;
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string& address) {
  void* const socket = open_socket(event_context(), ZMQ_PUB);
  if (zmq_connect(socket, address.c_str()) != 0) return failure("connect");
  return [socket](const EventStamp& stamp) -> Outcome {
    if (zmq_send(socket, &stamp, sizeof stamp, 0) < 0) return failure("send");
    return {};
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string& address,
                                                Note& note) {
  void* const socket = open_socket(event_context(), ZMQ_SUB);
  zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
  if (zmq_connect(socket, address.c_str()) != 0) return failure("connect");
  return [socket, &note] {
    EventStamp stamp;
    while (zmq_recv(socket, &stamp, sizeof stamp, 0) == sizeof stamp)
      note(&stamp, sizeof stamp);
  };
}

}  // namespace

const Peer kPeer{.serve = serve,
                 .connect = connect,
                 .serve_events = serve_events,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
