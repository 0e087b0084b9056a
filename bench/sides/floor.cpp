#include "sides/floor.hpp"

#include <netinet/tcp.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>

#include "rtpm/crypto/primitives.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "sides/raw_socket.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};

auto system_failure(std::string_view what) {
  return failure("the raw floor's " + std::string(what) + " failed: " + std::strerror(errno));
}

int type_of(Carrier carrier) {
  return carrier == Carrier::kUdp ? SOCK_DGRAM : SOCK_STREAM;
}

void send_at_once(int handle) {
  const int on = 1;
  setsockopt(handle, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

/// Lets a socket hold a whole frame; the kernel counts its datagrams at more than their bytes.
void make_room(int handle, std::size_t frame_size) noexcept {
  if (frame_size <= wire::kDatagramFrameSizeMax) return;
  const int size = static_cast<int>(4 * frame_size);
  if (setsockopt(handle, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) != 0)
    setsockopt(handle, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
}

/// One side's keys of a sealed floor.
class FloorSeal {
 public:
  explicit FloorSeal(bool is_caller) noexcept {
    const crypto::Suite suite = crypto::best_suite(crypto::suites_here(), crypto::suites_here());
    crypto::Secret key;
    std::ranges::fill(key.bytes(), std::byte{0x5e});
    (is_caller ? own_ : other_).set(suite, key);
    std::ranges::fill(key.bytes(), std::byte{0xa1});
    (is_caller ? other_ : own_).set(suite, key);
  }

  /// @param sealed  wire::kSealedTrailerSize bytes larger than `frame`
  void seal(const FloorFrame& frame, FloorFrame& sealed) noexcept {
    const MutableBytes out(sealed);
    std::memcpy(sealed.data(), frame.data(), wire::kHeaderSize);
    store_le(sealed.data() + frame.size(), counter_);
    own_.seal(counter_++, out.first(wire::kHeaderSize),
              ConstBytes(frame).subspan(wire::kHeaderSize),
              out.subspan(wire::kHeaderSize, frame.size() - wire::kHeaderSize),
              std::span<std::byte, crypto::kTagSize>(out.last(crypto::kTagSize)));
  }

  /// @return false if the other side did not seal it
  [[nodiscard]] bool open(const FloorFrame& sealed, FloorFrame& frame) const noexcept {
    const ConstBytes in(sealed);
    const auto counter = load_le<std::uint64_t>(sealed.data() + frame.size());
    std::memcpy(frame.data(), sealed.data(), wire::kHeaderSize);
    return other_.open(counter, in.first(wire::kHeaderSize),
                       in.subspan(wire::kHeaderSize, frame.size() - wire::kHeaderSize),
                       std::span<const std::byte, crypto::kTagSize>(in.last(crypto::kTagSize)),
                       MutableBytes(frame).subspan(wire::kHeaderSize));
  }

 private:
  crypto::AeadKey own_;
  crypto::AeadKey other_;
  std::uint64_t counter_ = 0;
};

/// A socket's frames, sent and received with a wait strategy.
class Frames {
 public:
  Frames(Carrier carrier, RawSocket socket, const FloorLaneConfig& lane, bool is_caller)
      : carrier_(carrier), socket_(std::move(socket)), strategy_(lane.wait.strategy) {
    if (strategy_ == rt::WaitStrategy::kAdaptive) spin_ = lane.wait.spin;
    // A raw side does not predict its callers; spinning is as quick.
    if (strategy_ == rt::WaitStrategy::kPeriodic) strategy_ = rt::WaitStrategy::kSpin;
    // A caller that blocks has its socket's time-out.
    if (strategy_ == rt::WaitStrategy::kSpin) spin_ = is_caller ? kTimeout : Duration::max();
    const std::size_t frame_size = floor_frame_size(carrier, lane.payload_size);
    if (carrier == Carrier::kUdp) make_room(socket_.handle(), frame_size);
    if (!lane.is_sealed) return;
    seal_ = std::make_unique<FloorSeal>(is_caller);
    sealed_.resize(frame_size + wire::kSealedTrailerSize);
  }

  /// Sends one datagram per part, or a stream at once. `to` is null if the socket is connected.
  bool send(const FloorFrame& frame, const sockaddr_in* to) noexcept {
    if (seal_) seal_->seal(frame, sealed_);
    const FloorFrame& moved = seal_ ? sealed_ : frame;
    const std::size_t part_max =
        carrier_ == Carrier::kUdp ? wire::kDatagramFrameSizeMax : moved.size();
    for (std::size_t done = 0; done < moved.size(); done += part_max) {
      const std::size_t size = std::min(part_max, moved.size() - done);
      if (!socket_.send({moved.data() + done, size}, to)) return false;
    }
    return true;
  }

  /// @return whether a whole frame came; if not, errno says why
  bool receive(FloorFrame& frame, sockaddr_in* from) noexcept {
    FloorFrame& moved = seal_ ? sealed_ : frame;
    ssize_t got = receive_part(moved, from);
    while (got > 0 && static_cast<std::size_t>(got) < moved.size()) {
      const auto rest = MutableBytes(moved).subspan(static_cast<std::size_t>(got));
      const ssize_t more = carrier_ == Carrier::kTcp ? socket_.receive(rest, MSG_WAITALL)
                                                     : receive_part(rest, nullptr);
      if (more <= 0) return false;
      got += more;
    }
    if (got <= 0) return false;
    if (!seal_ || seal_->open(sealed_, frame)) return true;
    errno = EBADMSG;
    return false;
  }

  /// Sends a received frame back. @param is_connected  to the socket's peer, not to its sender
  bool echo(FloorFrame& frame, bool is_connected) noexcept {
    sockaddr_in from{};
    sockaddr_in* const peer = is_connected ? nullptr : &from;
    if (!receive(frame, peer)) return false;
    compute_as_asked(frame);
    return send(frame, peer);
  }

 private:
  ssize_t receive_part(MutableBytes bytes, sockaddr_in* from) const noexcept {
    if (spin_ > Duration{0}) {
      const MonotonicTime end = spin_ == Duration::max() ? kNever : rt::now() + spin_;
      do {
        const ssize_t got = socket_.receive(bytes, MSG_DONTWAIT, from);
        if (got >= 0 || (errno != EAGAIN && errno != EINTR)) return got;
      } while (end == kNever || rt::now() < end);
      if (strategy_ == rt::WaitStrategy::kSpin) return -1;
    }
    return socket_.receive(bytes, 0, from);
  }

  Carrier carrier_;
  RawSocket socket_;
  rt::WaitStrategy strategy_;
  Duration spin_{0};
  std::unique_ptr<FloorSeal> seal_{};
  FloorFrame sealed_{};
};

void serve_udp(RawSocket socket, const FloorLaneConfig& lane) {
  FloorFrame frame(floor_frame_size(Carrier::kUdp, lane.payload_size));
  for (Frames frames(Carrier::kUdp, std::move(socket), lane, /*is_caller=*/false);;)
    frames.echo(frame, /*is_connected=*/false);
}

void serve_tcp(const RawSocket& listener, FloorLaneConfig lane) {
  // With several connections, only those that poll() found ready are read, so no read waits.
  const bool is_one = lane.connection_count == 1;
  if (!is_one) lane.wait = {.strategy = rt::WaitStrategy::kBlock};
  FloorFrame frame(floor_frame_size(Carrier::kTcp, lane.payload_size));
  std::vector<Frames> connections;
  std::vector<pollfd> polled;
  for (int i = 0; i < lane.connection_count; ++i) {
    RawSocket socket(accept(listener.handle(), nullptr, nullptr));
    send_at_once(socket.handle());
    polled.push_back({.fd = socket.handle(), .events = POLLIN, .revents = 0});
    connections.emplace_back(Carrier::kTcp, std::move(socket), lane, /*is_caller=*/false);
  }
  while (is_one && connections.front().echo(frame, /*is_connected=*/true)) {
  }
  while (!is_one && poll(polled.data(), polled.size(), -1) > 0) {
    for (std::size_t i = 0; i < polled.size(); ++i) {
      // poll() skips negative descriptors: here, those of connections that ended.
      if (polled[i].revents != 0 && !connections[i].echo(frame, true)) polled[i].fd = -1;
    }
  }
}

Outcome<std::uint16_t> start_lane(Carrier carrier, const FloorLaneConfig& lane,
                                  rt::RealtimeMode realtime) {
  auto socket = std::make_shared<RawSocket>(RawSocket::open(type_of(carrier)));
  if (!socket->bind(lane.host) || (carrier == Carrier::kTcp && listen(socket->handle(), 64) != 0)) {
    return system_failure("socket");
  }
  const std::uint16_t port = socket->port();
  const auto started = start_floor_thread(lane, realtime, [socket, carrier, lane] {
    carrier == Carrier::kUdp ? serve_udp(std::move(*socket), lane) : serve_tcp(*socket, lane);
  });
  if (!started) return failure(started.error());
  return port;
}

Outcome<RawSocket> connect_socket(Carrier carrier, const std::string& host, std::uint16_t port) {
  RawSocket socket = RawSocket::open(type_of(carrier));
  if (!socket.connect(address_of(host, port))) return system_failure("connect");
  if (carrier == Carrier::kTcp) send_at_once(socket.handle());
  socket.set_patience({.tv_sec = 1, .tv_usec = 0});
  return socket;
}

}  // namespace

std::size_t floor_frame_size(Carrier carrier, std::size_t payload_size) noexcept {
  if (carrier != Carrier::kUdp) return wire::kHeaderSize + payload_size;
  const std::size_t datagram_count = std::max<std::size_t>(
      1, (payload_size + wire::kDatagramPayloadSizeMax - 1) / wire::kDatagramPayloadSizeMax);
  return datagram_count * wire::kHeaderSize + payload_size;
}

Outcome<> start_floor_thread(const FloorLaneConfig& lane, rt::RealtimeMode realtime,
                             std::function<void()> body) {
  auto thread = rt::Thread::start(
      {.name = lane.name, .priority = lane.priority, .cpus = {lane.cpu}, .realtime = realtime},
      std::move(body));
  if (!thread) return failure(thread.error());
  static auto& started = *new std::vector<rt::Thread>;
  started.push_back(std::move(*thread));
  return {};
}

Outcome<std::vector<std::uint16_t>> start_floor_server(Carrier carrier,
                                                       const std::vector<FloorLaneConfig>& lanes,
                                                       rt::RealtimeMode realtime) {
  std::vector<std::uint16_t> ports;
  for (const FloorLaneConfig& lane : lanes) {
    const auto port = start_lane(carrier, lane, realtime);
    if (!port) return failure(port.error());
    ports.push_back(*port);
  }
  if (auto locked = rt::lock_memory(realtime); !locked) return failure(locked.error());
  return ports;
}

Outcome<Call> connect_floor_caller(Carrier carrier, std::uint16_t port,
                                   const FloorLaneConfig& lane) {
  auto socket = connect_socket(carrier, lane.host, port);
  if (!socket) return failure(socket.error());
  return make_floor_caller(floor_frame_size(carrier, lane.payload_size),
                           [frames = Frames(carrier, std::move(*socket), lane, /*is_caller=*/true)](
                               const FloorFrame& sent, FloorFrame& received) mutable -> Outcome<> {
                             if (!frames.send(sent, nullptr)) return system_failure("send");
                             if (!frames.receive(received, nullptr))
                               return system_failure("receive");
                             return {};
                           });
}

Outcome<Pipeline> connect_floor_pipeline(std::uint16_t port, const FloorLaneConfig& lane) {
  auto connected = connect_socket(Carrier::kUdp, lane.host, port);
  if (!connected) return failure(connected.error());
  return Pipeline([socket = std::make_shared<RawSocket>(std::move(*connected)),
                   sent = make_floor_frame(kFloorFrameSize)](std::uint64_t count) -> Outcome<> {
    FloorFrame received(kFloorFrameSize);
    std::uint64_t begun = 0;
    for (std::uint64_t taken = 0; taken < count; ++taken) {
      for (; begun < std::min<std::uint64_t>(count, taken + kInFlight); ++begun) {
        if (!socket->send(sent)) return system_failure("send");
      }
      if (socket->receive(received, 0) < 0) return system_failure("receive");
      if (auto echoed = check_floor_echo(sent, received); !echoed) return echoed;
    }
    return {};
  });
}

}  // namespace rtpm::bench
