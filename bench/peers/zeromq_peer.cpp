#include <zmq.h>

#include <atomic>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include "peer.hpp"
#include "rtpm/rt/clock.hpp"

// ZeroMQ: REQ and REP sockets, which are its calls. Tuning, as the guide and zmq_setsockopt(3) have
// it: nothing is batched on the wire (ZeroMQ sets TCP_NODELAY by itself), one I/O thread per
// context, and no lingering. Each lane has a context of its own, so that its I/O thread has the
// lane's priority: a context's threads are started by its first socket, and inherit. Events go
// through zmq_proxy between XSUB and XPUB, which is the guide's own broker.
namespace rtpm::bench {
namespace {

constexpr int kTimeoutMs = 1000;

std::string text_of(std::string_view what) {
  return "ZeroMQ's " + std::string(what) + " failed: " + zmq_strerror(zmq_errno());
}

/// A socket, in a context of its own or in another one's.
class Socket {
 public:
  explicit Socket(int type) : context_(zmq_ctx_new(), zmq_ctx_term) { open(type); }
  Socket(const Socket& neighbour, int type) : context_(neighbour.context_) { open(type); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { zmq_close(socket_); }
  [[nodiscard]] void* get() const noexcept { return socket_; }

 private:
  void open(int type) {
    socket_ = zmq_socket(context_.get(), type);
    const int no_wait = 0;
    zmq_setsockopt(socket_, ZMQ_LINGER, &no_wait, sizeof no_wait);
  }
  std::shared_ptr<void> context_;
  void* socket_ = nullptr;
};

/// Binds a socket to an end of the lane, and gives back where that is.
expected<std::string, std::string> bind(const Socket& socket, const PeerLane& lane,
                                        std::string_view name) {
  const std::string wanted = lane.transport == "ipc"
                                 ? "ipc://" + lane.socket_path() + std::string(name)
                                 : std::string("tcp://127.0.0.1:*");
  if (zmq_bind(socket.get(), wanted.c_str()) != 0) return unexpected{text_of("bind")};
  std::array<char, 256> address{};
  std::size_t size = address.size();
  zmq_getsockopt(socket.get(), ZMQ_LAST_ENDPOINT, address.data(), &size);
  return std::string(address.data());
}

/// A publisher, and subscribers that share its context and so its I/O thread, which has one CPU
/// with them.
class ZeromqSide final : public PeerEventSide {
 public:
  ~ZeromqSide() override {
    is_stopping_ = true;
    threads_.clear();
  }

  /// `addresses`: the proxy's two.
  [[nodiscard]] expected<void, std::string> begin(const std::string& addresses, int consumer_count,
                                                  EventBoard& board) {
    std::istringstream words(addresses);
    std::string in;
    std::string out;
    words >> in >> out;
    if (zmq_connect(supplier_.get(), in.c_str()) != 0) return unexpected{text_of("connect")};
    for (int i = 0; i < consumer_count; ++i) {
      const Socket& socket = *sockets_.emplace_back(std::make_unique<Socket>(supplier_, ZMQ_SUB));
      zmq_setsockopt(socket.get(), ZMQ_SUBSCRIBE, "", 0);
      zmq_setsockopt(socket.get(), ZMQ_RCVTIMEO, &kTimeoutMs, sizeof kTimeoutMs);
      if (zmq_connect(socket.get(), out.c_str()) != 0) return unexpected{text_of("connect")};
      auto thread = start_consumer(
          [this, &socket, &board, number = sockets_.size() - 1] { take(socket, number, board); });
      if (!thread) return unexpected{thread.error()};
      threads_.push_back(std::move(*thread));
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    if (zmq_send(supplier_.get(), &stamp, sizeof stamp, 0) < 0) return unexpected{text_of("send")};
    return {};
  }

 private:
  void take(const Socket& socket, std::size_t number, EventBoard& board) const {
    EventStamp stamp;
    while (!is_stopping_) {
      if (zmq_recv(socket.get(), &stamp, sizeof stamp, 0) != sizeof stamp) continue;
      board.note(number, std::as_bytes(std::span(&stamp, 1)), rt::now());
    }
  }

  Socket supplier_{ZMQ_PUB};
  std::vector<std::unique_ptr<Socket>> sockets_{};
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
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
  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    const Socket socket(ZMQ_REP);
    const auto address = bind(socket, lane, "calls");
    if (!address) return unexpected{address.error()};
    publish_link_report(*address);
    PeerMessage message;
    while (zmq_recv(socket.get(), &message, sizeof message, 0) == sizeof message) {
      answer(message);
      if (zmq_send(socket.get(), &message, sizeof message, 0) < 0) break;
    }
    return unexpected{text_of("server")};
  }

  expected<void, std::string> serve_events(const PeerLane& lane,
                                           const Announce& publish_link_report) override {
    const Socket in(ZMQ_XSUB);
    const Socket out(in, ZMQ_XPUB);
    std::string addresses;
    for (const auto& [socket, name] : {std::pair{&in, "in"}, {&out, "out"}}) {
      const auto address = bind(*socket, lane, name);
      if (!address) return unexpected{address.error()};
      addresses += *address + " ";
    }
    publish_link_report(addresses);
    zmq_proxy(in.get(), out.get(), nullptr);
    return unexpected{text_of("proxy")};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string& address,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    return begin_side<ZeromqSide>(address, consumer_count, board);
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    return connect_caller<ZeromqCaller>(address);
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<ZeromqPeer>();
}

}  // namespace rtpm::bench
