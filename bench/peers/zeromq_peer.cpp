#include <zmq.h>

#include "peer.hpp"

// ZeroMQ: REQ and REP sockets, which are its calls. Tuning, as the guide and zmq_setsockopt(3) have
// it: nothing is batched on the wire (ZeroMQ sets TCP_NODELAY by itself), one I/O thread per
// context, and no lingering. Each lane has a context of its own, so that its I/O thread has the
// lane's priority: a context's threads are started by its first socket, and inherit.
namespace rtpm::bench {
namespace {

constexpr int kTimeoutMs = 1000;

std::string text_of(std::string_view what) {
  return "ZeroMQ's " + std::string(what) + " failed: " + zmq_strerror(zmq_errno());
}

/// A context with one socket.
class Socket {
 public:
  explicit Socket(int type) : context_(zmq_ctx_new()), socket_(zmq_socket(context_, type)) {
    const int no_linger = 0;
    zmq_setsockopt(socket_, ZMQ_LINGER, &no_linger, sizeof no_linger);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    zmq_close(socket_);
    zmq_ctx_term(context_);
  }
  [[nodiscard]] void* get() const noexcept { return socket_; }

 private:
  void* context_;
  void* socket_;
};

class ZeromqCaller final : public PeerCaller {
 public:
  [[nodiscard]] expected<void, std::string> connect(const std::string& address) {
    zmq_setsockopt(socket_.get(), ZMQ_RCVTIMEO, &kTimeoutMs, sizeof kTimeoutMs);
    zmq_setsockopt(socket_.get(), ZMQ_SNDTIMEO, &kTimeoutMs, sizeof kTimeoutMs);
    if (zmq_connect(socket_.get(), address.c_str()) != 0) return unexpected{text_of("connect")};
    return {};
  }

 protected:
  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) override {
    if (zmq_send(socket_.get(), &request, sizeof request, 0) < 0) {
      return unexpected{text_of("send")};
    }
    if (zmq_recv(socket_.get(), &reply, sizeof reply, 0) != sizeof reply) {
      return unexpected{text_of("receive")};
    }
    return {};
  }

 private:
  Socket socket_{ZMQ_REQ};
};

class ZeromqPeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane& lane, const Announce& announce) override {
    const Socket socket(ZMQ_REP);
    const std::string wanted =
        lane.transport == "ipc" ? "ipc://" + lane.socket_path() : "tcp://127.0.0.1:*";
    if (zmq_bind(socket.get(), wanted.c_str()) != 0) return unexpected{text_of("bind")};
    std::array<char, 256> address{};
    std::size_t size = address.size();
    zmq_getsockopt(socket.get(), ZMQ_LAST_ENDPOINT, address.data(), &size);
    announce(address.data());
    PeerMessage message;
    while (zmq_recv(socket.get(), &message, sizeof message, 0) == sizeof message) {
      answer(message);
      if (zmq_send(socket.get(), &message, sizeof message, 0) < 0) break;
    }
    return unexpected{text_of("server")};
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    auto caller = std::make_unique<ZeromqCaller>();
    if (auto connected = caller->connect(address); !connected) {
      return unexpected{connected.error()};
    }
    return std::unique_ptr<Caller>(std::move(caller));
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<ZeromqPeer>();
}

}  // namespace rtpm::bench
