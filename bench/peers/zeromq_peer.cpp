#include <zmq.h>

#include <array>

#include "sockets.hpp"

// ZeroMQ: REQ and REP sockets, which are its calls. Tuned as the guide and zmq_setsockopt(3)
// recommend: nothing is batched on the wire (ZeroMQ sets TCP_NODELAY by itself), one I/O thread per
// context, and no lingering. Each lane has a context of its own, so that its I/O thread has the
// lane's priority: a context's threads are started by its first socket, and inherit. Events go
// through zmq_proxy between XSUB and XPUB, which is the guide's own broker. Supplier and consumers
// share a context and so its I/O thread, which has one CPU with them.
namespace rtpm::bench {
namespace {

struct Zeromq {
  using Socket = void*;
  static constexpr bool kConnectsAtHighPriority = false;

  static auto failure(const char* what) {
    return failure_of("ZeroMQ", what, zmq_strerror(zmq_errno()));
  }

  static void set_option(void* socket, int option, int value) {
    zmq_setsockopt(socket, option, &value, sizeof value);
  }

  static void* open(SocketKind kind) {
    constexpr std::array kTypes{ZMQ_REP, ZMQ_REQ, ZMQ_PUB, ZMQ_SUB, ZMQ_XSUB, ZMQ_XPUB};
    static void* const kEventContext = zmq_ctx_new();
    const bool is_call = kind == SocketKind::kReply || kind == SocketKind::kRequest;
    void* const socket =
        zmq_socket(is_call ? zmq_ctx_new() : kEventContext, kTypes[static_cast<std::size_t>(kind)]);
    set_option(socket, ZMQ_LINGER, 0);
    if (kind == SocketKind::kSubscribe) zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
    if (kind != SocketKind::kRequest) return socket;
    set_option(socket, ZMQ_RCVTIMEO, 1000);
    set_option(socket, ZMQ_SNDTIMEO, 1000);
    return socket;
  }

  static Outcome<Listener<void*>> listen(SocketKind kind, const PeerLane& lane, const char* name) {
    void* const socket = open(kind);
    const std::string wanted = lane.transport == "ipc" ? "ipc://" + lane.socket_path() + name
                                                       : std::string("tcp://127.0.0.1:*");
    if (zmq_bind(socket, wanted.c_str()) != 0) return failure("bind");
    std::array<char, 256> address{};
    std::size_t size = address.size();
    zmq_getsockopt(socket, ZMQ_LAST_ENDPOINT, address.data(), &size);
    return Listener<void*>{socket, address.data()};
  }
  static auto listen_for_calls(const PeerLane& lane) {
    return listen(SocketKind::kReply, lane, "calls");
  }

  static Outcome<void*> dial(SocketKind kind, const std::string& address) {
    void* const socket = open(kind);
    if (zmq_connect(socket, address.c_str()) != 0) return failure("connect");
    return socket;
  }

  static bool send(void* socket, const void* bytes, std::size_t size) {
    return zmq_send(socket, bytes, size, 0) >= 0;
  }
  static bool receive(void* socket, void* bytes, std::size_t size) {
    return zmq_recv(socket, bytes, size, 0) == static_cast<int>(size);
  }
  static void forward(void* in, void* out) { zmq_proxy(in, out, nullptr); }
};

}  // namespace

const Peer kPeer = SocketPeer<Zeromq>::kFunctions;

}  // namespace rtpm::bench
