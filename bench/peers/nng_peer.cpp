#include <nng/nng.h>
#include <nng/protocol/pubsub0/pub.h>
#include <nng/protocol/pubsub0/sub.h>
#include <nng/protocol/reqrep0/rep.h>
#include <nng/protocol/reqrep0/req.h>

#include <span>
#include <sstream>
#include <vector>

#include "peer.hpp"
#include "rtpm/rt/clock.hpp"

// nng: REQ and REP sockets, used synchronously. TCP_NODELAY is its default. Its input and output
// run on a pool that a process has once, started by the first use of the library and so with the
// measured caller's priority; requests of either lane are answered by the lane's own thread. Events
// go through nng_device between two raw sockets, which is its own broker.
namespace rtpm::bench {
namespace {

constexpr nng_duration kTimeoutMs = 1000;
/// Events that a queue holds before it loses some; the default, 16, is few for a busy machine.
constexpr int kQueuedMax = 1024;

std::string text_of(std::string_view what, int error) {
  return "nng's " + std::string(what) + " failed: " + nng_strerror(error);
}

class NngCaller final : public PeerCaller {
 public:
  NngCaller() = default;
  ~NngCaller() override { nng_close(socket_); }

  [[nodiscard]] expected<void, std::string> connect(const std::string& address) {
    if (const int error = nng_req0_open(&socket_)) return unexpected{text_of("socket", error)};
    nng_socket_set_ms(socket_, NNG_OPT_RECVTIMEO, kTimeoutMs);
    nng_socket_set_ms(socket_, NNG_OPT_SENDTIMEO, kTimeoutMs);
    if (const int error = nng_dial(socket_, address.c_str(), nullptr, 0)) {
      return unexpected{text_of("connect", error)};
    }
    return {};
  }

 protected:
  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) override {
    PeerMessage sent = request;
    if (const int error = nng_send(socket_, &sent, sizeof sent, 0)) {
      return unexpected{text_of("send", error)};
    }
    std::size_t size = sizeof reply;
    if (const int error = nng_recv(socket_, &reply, &size, 0)) {
      return unexpected{text_of("receive", error)};
    }
    return {};
  }

 private:
  nng_socket socket_ = NNG_SOCKET_INITIALIZER;
};

/// Where a listener that chose its port by itself listens.
expected<std::string, std::string> address_of(nng_listener listener) {
  nng_sockaddr address{};
  if (const int error = nng_listener_get_addr(listener, NNG_OPT_LOCADDR, &address)) {
    return unexpected{text_of("address", error)};
  }
  const auto port =
      static_cast<std::uint16_t>((address.s_in.sa_port >> 8) | (address.s_in.sa_port << 8));
  return "tcp://127.0.0.1:" + std::to_string(port);
}

/// A publisher, and subscribers with a thread each.
class NngSide final : public PeerEventSide {
 public:
  ~NngSide() override {
    for (const nng_socket socket : sockets_)
      nng_close(socket);
    threads_.clear();
    nng_close(supplier_);
  }

  /// `addresses`: the device's two.
  [[nodiscard]] expected<void, std::string> begin(const std::string& addresses, int consumer_count,
                                                  EventBoard& board) {
    std::istringstream words(addresses);
    std::string in;
    std::string out;
    words >> in >> out;
    nng_pub0_open(&supplier_);
    nng_socket_set_int(supplier_, NNG_OPT_SENDBUF, kQueuedMax);
    if (const int error = nng_dial(supplier_, in.c_str(), nullptr, 0)) {
      return unexpected{text_of("connect", error)};
    }
    for (int i = 0; i < consumer_count; ++i) {
      nng_socket& socket = sockets_.emplace_back();
      nng_sub0_open(&socket);
      nng_socket_set_int(socket, NNG_OPT_RECVBUF, kQueuedMax);
      nng_socket_set(socket, NNG_OPT_SUB_SUBSCRIBE, "", 0);
      if (const int error = nng_dial(socket, out.c_str(), nullptr, 0)) {
        return unexpected{text_of("connect", error)};
      }
      auto thread = start_consumer([socket, &board, number = sockets_.size() - 1] {
        EventStamp stamp;
        std::size_t size = sizeof stamp;
        while (nng_recv(socket, &stamp, &size, 0) == 0)
          board.note(number, std::as_bytes(std::span(&stamp, 1)), rt::now());
      });
      if (!thread) return unexpected{thread.error()};
      threads_.push_back(std::move(*thread));
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    EventStamp sent = stamp;
    if (const int error = nng_send(supplier_, &sent, sizeof sent, 0)) {
      return unexpected{text_of("send", error)};
    }
    return {};
  }

 private:
  nng_socket supplier_ = NNG_SOCKET_INITIALIZER;
  std::vector<nng_socket> sockets_{};
  std::vector<rt::Thread> threads_{};
};

class NngPeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    // The first lane's thread opens both ends: while one is being opened, the library's own thread
    // looks at it without pause, and would keep a thread of low priority from going on.
    if (lane.index == 0) {
      for (std::size_t index = 0; index < kPeerLaneCount; ++index) {
        if (const int error = nng_rep0_open(&sockets_[index])) {
          return unexpected{text_of("socket", error)};
        }
        if (auto opened = listen(index, lane); !opened) return opened;
      }
    }
    publish_link_report(addresses_[lane.index]);
    const nng_socket socket = sockets_[lane.index];
    PeerMessage message;
    for (std::size_t size = sizeof message; nng_recv(socket, &message, &size, 0) == 0;
         size = sizeof message) {
      answer(message);
      if (const int error = nng_send(socket, &message, size, 0)) {
        return unexpected{text_of("send", error)};
      }
    }
    return unexpected{std::string("nng's server ended")};
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    return connect_caller<NngCaller>(address);
  }

  expected<void, std::string> serve_events(const PeerLane& lane,
                                           const Announce& publish_link_report) override {
    nng_sub0_open_raw(&sockets_[0]);
    nng_pub0_open_raw(&sockets_[1]);
    nng_socket_set_int(sockets_[0], NNG_OPT_RECVBUF, kQueuedMax);
    nng_socket_set_int(sockets_[1], NNG_OPT_SENDBUF, kQueuedMax);
    std::string addresses;
    for (std::size_t index = 0; index < kPeerLaneCount; ++index) {
      if (auto opened = listen(index, lane); !opened) return opened;
      addresses += addresses_[index] + " ";
    }
    publish_link_report(addresses);
    return unexpected{text_of("device", nng_device(sockets_[0], sockets_[1]))};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string& address,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    return begin_side<NngSide>(address, consumer_count, board);
  }

  /// As in serve(), of the ends that connect.
  [[nodiscard]] bool connects_at_high_priority() const override { return true; }

 private:
  [[nodiscard]] expected<void, std::string> listen(std::size_t index, PeerLane lane) {
    lane.index = index;
    const bool is_ipc = lane.transport == "ipc";
    const std::string end = is_ipc ? "ipc://" + lane.socket_path() : "tcp://127.0.0.1:0";
    nng_listener listener = NNG_LISTENER_INITIALIZER;
    if (const int error = nng_listen(sockets_[index], end.c_str(), &listener, 0)) {
      return unexpected{text_of("listen", error)};
    }
    const auto address = is_ipc ? expected<std::string, std::string>(end) : address_of(listener);
    if (!address) return unexpected{address.error()};
    addresses_[index] = *address;
    return {};
  }

  std::array<nng_socket, kPeerLaneCount> sockets_{};
  std::array<std::string, kPeerLaneCount> addresses_{};
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<NngPeer>();
}

}  // namespace rtpm::bench
