#include <nng/nng.h>
#include <nng/protocol/pubsub0/pub.h>
#include <nng/protocol/pubsub0/sub.h>
#include <nng/protocol/reqrep0/rep.h>
#include <nng/protocol/reqrep0/req.h>

#include <array>

#include "sockets.hpp"

// nng: REQ and REP sockets, used synchronously. TCP_NODELAY is its default. Its input and output
// run on a pool that a process has once, started by the first use of the library and so with the
// measured caller's priority; requests of either lane are answered by the lane's own thread. Events
// go through nng_device between two raw sockets, which is its own broker.
namespace rtpm::bench {
namespace {

struct Nng {
  using Socket = nng_socket;
  static constexpr bool kConnectsAtHighPriority = true;  ///< See listen_for_calls().
  static inline thread_local int error = 0;

  static auto failure(const char* what) { return failure_of("nng", what, nng_strerror(error)); }

  static nng_socket open(SocketKind kind) {
    constexpr std::array kOpen{nng_rep0_open, nng_req0_open,     nng_pub0_open,
                               nng_sub0_open, nng_sub0_open_raw, nng_pub0_open_raw};
    nng_socket socket = NNG_SOCKET_INITIALIZER;
    kOpen[static_cast<std::size_t>(kind)](&socket);
    if (kind == SocketKind::kReply) return socket;
    if (kind == SocketKind::kRequest) {
      nng_socket_set_ms(socket, NNG_OPT_RECVTIMEO, 1000);
      nng_socket_set_ms(socket, NNG_OPT_SENDTIMEO, 1000);
      return socket;
    }
    const bool sends = kind == SocketKind::kPublish || kind == SocketKind::kToSubscribers;
    nng_socket_set_int(socket, sends ? NNG_OPT_SENDBUF : NNG_OPT_RECVBUF, kEventQueueMax);
    if (kind == SocketKind::kSubscribe) nng_socket_set(socket, NNG_OPT_SUB_SUBSCRIBE, "", 0);
    return socket;
  }

  static Outcome<Listener<nng_socket>> listen(SocketKind kind, const PeerLane& lane,
                                              const char* name) {
    const nng_socket socket = open(kind);
    const bool is_ipc = lane.transport == "ipc";
    const std::string end =
        is_ipc ? "ipc://" + lane.socket_path() + name : std::string("tcp://127.0.0.1:0");
    nng_listener listener = NNG_LISTENER_INITIALIZER;
    nng_sockaddr address{};
    error = nng_listen(socket, end.c_str(), &listener, 0);
    if (error == 0) error = nng_listener_get_addr(listener, NNG_OPT_LOCADDR, &address);
    if (error != 0) return failure("listen");
    const std::uint16_t port = __builtin_bswap16(address.s_in.sa_port);
    return Listener<nng_socket>{socket, is_ipc ? end : "tcp://127.0.0.1:" + std::to_string(port)};
  }

  /// The first lane's thread opens both ends: while one is being opened, the library's own thread
  /// polls it without pause, and would keep a thread of low priority from going on.
  static Outcome<Listener<nng_socket>> listen_for_calls(const PeerLane& lane) {
    static auto first = listen(SocketKind::kReply, lane, "high");
    static auto second = listen(SocketKind::kReply, lane, "low");
    return lane.index == 0 ? first : second;
  }

  static Outcome<nng_socket> dial(SocketKind kind, const std::string& address) {
    const nng_socket socket = open(kind);
    error = nng_dial(socket, address.c_str(), nullptr, 0);
    if (error != 0) return failure("connect");
    return socket;
  }

  static bool send(nng_socket socket, const void* bytes, std::size_t size) {
    error = nng_send(socket, const_cast<void*>(bytes), size, 0);
    return error == 0;
  }
  static bool receive(nng_socket socket, void* bytes, std::size_t size) {
    error = nng_recv(socket, bytes, &size, 0);
    return error == 0;
  }
  static void forward(nng_socket in, nng_socket out) { error = nng_device(in, out); }
};

}  // namespace

const Peer kPeer = SocketPeer<Nng>::kFunctions;

}  // namespace rtpm::bench
