#include "sides/floor.hpp"

#include <netinet/tcp.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <list>
#include <optional>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "sides/raw_socket.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};

std::string system_text(std::string_view what) {
  return "the raw floor's " + std::string(what) + " failed: " + std::strerror(errno);
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

/// A socket's frames, sent and received with a wait strategy.
class Frames {
 public:
  /// `give_up`: the time after which a spinning receiver fails; a blocking one has its socket's
  /// time-out.
  Frames(Carrier carrier, RawSocket socket, const rt::WaitConfig& wait, Duration give_up)
      : carrier_(carrier), socket_(std::move(socket)), strategy_(wait.strategy) {
    if (strategy_ == rt::WaitStrategy::kAdaptive) spin_ = wait.spin;
    // A raw side does not predict its callers; spinning is as quick.
    if (strategy_ == rt::WaitStrategy::kPeriodic) strategy_ = rt::WaitStrategy::kSpin;
    if (strategy_ == rt::WaitStrategy::kSpin) spin_ = give_up;
  }

  /// Sends one datagram per part, or a stream at once. `to` is null if the socket is connected.
  bool send(const FloorFrame& frame, const sockaddr_in* to) const noexcept {
    const std::size_t part_max =
        carrier_ == Carrier::kUdp ? wire::kDatagramFrameSizeMax : frame.size();
    for (std::size_t done = 0; done < frame.size(); done += part_max) {
      const std::size_t size = std::min(part_max, frame.size() - done);
      if (!socket_.send({frame.data() + done, size}, to)) return false;
    }
    return true;
  }

  /// @return whether a whole frame came; if not, errno says why
  bool receive(FloorFrame& frame, sockaddr_in* from) const noexcept {
    ssize_t got = receive_part(frame, from);
    while (got > 0 && static_cast<std::size_t>(got) < frame.size()) {
      const auto rest = MutableBytes(frame).subspan(static_cast<std::size_t>(got));
      const ssize_t more = carrier_ == Carrier::kTcp ? socket_.receive(rest, MSG_WAITALL)
                                                     : receive_part(rest, nullptr);
      if (more <= 0) return false;
      got += more;
    }
    return got > 0;
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
};

// ---- serving ------------------------------------------------------------------------------------

/// Receives a lane's frames and sends each back; holds one frame and its sealed form.
class Echo {
 public:
  Echo(Carrier carrier, const FloorLaneConfig& lane)
      : frame_(floor_frame_size(carrier, lane.payload_size)) {
    if (!lane.is_sealed) return;
    seal_.emplace(/*is_client=*/false);
    sealed_.resize(frame_.size() + wire::kSealedTrailerSize);
  }
  [[nodiscard]] std::size_t size() const noexcept { return frame_.size(); }

  /// @param is_connected  sends to the socket's connected peer, not to the frame's sender
  bool serve(const Frames& frames, bool is_connected) noexcept {
    FloorFrame& moved = seal_ ? sealed_ : frame_;
    sockaddr_in from{};
    if (!frames.receive(moved, is_connected ? nullptr : &from)) return false;
    if (seal_ && !seal_->open(sealed_, frame_)) return false;
    compute_as_asked(frame_);
    if (seal_) seal_->seal(frame_, sealed_);
    return frames.send(moved, is_connected ? nullptr : &from);
  }

 private:
  FloorFrame frame_;
  FloorFrame sealed_{};
  std::optional<FloorSeal> seal_{};
};

void serve_udp(RawSocket socket, const FloorLaneConfig& lane) {
  Echo echo(Carrier::kUdp, lane);
  make_room(socket.handle(), echo.size());
  const Frames frames(Carrier::kUdp, std::move(socket), lane.wait, Duration::max());
  for (;;)
    echo.serve(frames, /*is_connected=*/false);
}

void serve_tcp(const RawSocket& listener, const FloorLaneConfig& lane) {
  std::list<Echo> echoes;
  // With several connections, only those that poll() found ready are read, so no read waits.
  const bool is_one = lane.connection_count == 1;
  const rt::WaitConfig wait =
      is_one ? lane.wait : rt::WaitConfig{.strategy = rt::WaitStrategy::kBlock};
  std::vector<Frames> connections;
  std::vector<pollfd> polled;
  for (int i = 0; i < lane.connection_count; ++i) {
    RawSocket socket(accept(listener.handle(), nullptr, nullptr));
    send_at_once(socket.handle());
    polled.push_back({.fd = socket.handle(), .events = POLLIN, .revents = 0});
    connections.emplace_back(Carrier::kTcp, std::move(socket), wait, Duration::max());
    echoes.emplace_back(Carrier::kTcp, lane);
  }
  while (is_one && echoes.front().serve(connections.front(), /*is_connected=*/true)) {
  }
  while (!is_one && poll(polled.data(), polled.size(), -1) > 0) {
    auto echo = echoes.begin();
    for (std::size_t i = 0; i < polled.size(); ++i, ++echo) {
      // poll() skips negative descriptors: here, those of connections that ended.
      if (polled[i].revents != 0 && !echo->serve(connections[i], true)) polled[i].fd = -1;
    }
  }
}

expected<std::uint16_t, std::string> start_lane(Carrier carrier, const FloorLaneConfig& lane,
                                                rt::RealtimeMode realtime) {
  auto socket = std::make_shared<RawSocket>(RawSocket::open(type_of(carrier)));
  if (!socket->bind(lane.host) || (carrier == Carrier::kTcp && listen(socket->handle(), 64) != 0)) {
    return unexpected{system_text("socket")};
  }
  const std::uint16_t port = socket->port();
  const auto started = start_floor_thread(lane, realtime, [socket, carrier, lane] {
    carrier == Carrier::kUdp ? serve_udp(std::move(*socket), lane) : serve_tcp(*socket, lane);
  });
  if (!started) return unexpected{started.error()};
  return port;
}

// ---- calling ------------------------------------------------------------------------------------

expected<RawSocket, std::string> connect_socket(Carrier carrier, const std::string& host,
                                                std::uint16_t port) {
  RawSocket socket = RawSocket::open(type_of(carrier));
  if (!socket.connect(address_of(host, port))) return unexpected{system_text("connect")};
  if (carrier == Carrier::kTcp) send_at_once(socket.handle());
  socket.set_patience({.tv_sec = 1, .tv_usec = 0});
  return socket;
}

struct SocketExchange {
  expected<void, std::string> operator()(const FloorFrame& sent, FloorFrame& received) const {
    if (!frames.send(sent, nullptr)) return unexpected{system_text("send")};
    if (!frames.receive(received, nullptr)) return unexpected{system_text("receive")};
    return {};
  }
  Frames frames;
};

struct SealedExchange {
  explicit SealedExchange(Frames given, std::size_t frame_size)
      : frames(std::move(given)),
        seal(std::make_unique<FloorSeal>(/*is_client=*/true)),
        moved(frame_size + wire::kSealedTrailerSize) {}
  expected<void, std::string> operator()(const FloorFrame& sent, FloorFrame& received) {
    seal->seal(sent, moved);
    if (!frames.send(moved, nullptr)) return unexpected{system_text("send")};
    if (!frames.receive(moved, nullptr)) return unexpected{system_text("receive")};
    if (seal->open(moved, received)) return {};
    return unexpected{std::string("the raw floor's answer is not sealed as it should be")};
  }
  Frames frames;
  std::unique_ptr<FloorSeal> seal;
  FloorFrame moved;
};

class FloorPipeline final : public Pipeline {
 public:
  explicit FloorPipeline(RawSocket socket) : socket_(std::move(socket)) {}

  expected<void, std::string> run(std::uint64_t count) override {
    std::uint64_t begun = 0;
    for (std::uint64_t taken = 0; taken < count; ++taken) {
      for (; begun < std::min<std::uint64_t>(count, taken + kInFlight); ++begun) {
        if (!socket_.send(sent_)) return unexpected{system_text("send")};
      }
      if (socket_.receive(received_, 0) < 0) return unexpected{system_text("receive")};
      if (std::memcmp(received_.data(), sent_.data(), sent_.size()) != 0) {
        return unexpected{std::string("the raw floor's echo differs")};
      }
    }
    return {};
  }

 private:
  RawSocket socket_;
  FloorFrame sent_ = make_floor_frame(kFloorFrameSize);
  FloorFrame received_ = FloorFrame(kFloorFrameSize);
};

}  // namespace

FloorSeal::FloorSeal(bool is_client) noexcept {
  const crypto::Suite suite = crypto::best_suite(crypto::suites_here(), crypto::suites_here());
  crypto::Secret key;
  std::ranges::fill(key.bytes(), std::byte{0x5e});
  (is_client ? own_ : other_).set(suite, key);
  std::ranges::fill(key.bytes(), std::byte{0xa1});
  (is_client ? other_ : own_).set(suite, key);
}

void FloorSeal::seal(const FloorFrame& frame, FloorFrame& sealed) noexcept {
  const MutableBytes out(sealed);
  const std::size_t payload_size = frame.size() - wire::kHeaderSize;
  std::memcpy(sealed.data(), frame.data(), wire::kHeaderSize);
  store_le(sealed.data() + frame.size(), counter_);
  own_.seal(counter_++, out.first(wire::kHeaderSize), ConstBytes(frame).subspan(wire::kHeaderSize),
            out.subspan(wire::kHeaderSize, payload_size),
            std::span<std::byte, crypto::kTagSize>(out.last(crypto::kTagSize)));
}

bool FloorSeal::open(const FloorFrame& sealed, FloorFrame& frame) const noexcept {
  const ConstBytes in(sealed);
  const std::size_t payload_size = frame.size() - wire::kHeaderSize;
  const auto counter = load_le<std::uint64_t>(sealed.data() + frame.size());
  std::memcpy(frame.data(), sealed.data(), wire::kHeaderSize);
  return other_.open(counter, in.first(wire::kHeaderSize),
                     in.subspan(wire::kHeaderSize, payload_size),
                     std::span<const std::byte, crypto::kTagSize>(in.last(crypto::kTagSize)),
                     MutableBytes(frame).subspan(wire::kHeaderSize));
}

std::size_t floor_frame_size(Carrier carrier, std::size_t payload_size) noexcept {
  if (carrier != Carrier::kUdp) return wire::kHeaderSize + payload_size;
  const std::size_t datagram_count = std::max<std::size_t>(
      1, (payload_size + wire::kDatagramPayloadSizeMax - 1) / wire::kDatagramPayloadSizeMax);
  return datagram_count * wire::kHeaderSize + payload_size;
}

expected<void, std::string> start_floor_thread(const FloorLaneConfig& lane,
                                               rt::RealtimeMode realtime,
                                               std::function<void()> body) {
  auto thread = rt::Thread::start(
      {.name = lane.name, .priority = lane.priority, .cpus = {lane.cpu}, .realtime = realtime},
      std::move(body));
  if (!thread) return unexpected{thread.error().text()};
  static auto& started = *new std::vector<rt::Thread>;
  started.push_back(std::move(*thread));
  return {};
}

expected<std::vector<std::uint16_t>, std::string> start_floor_server(
    Carrier carrier, const std::vector<FloorLaneConfig>& lanes, rt::RealtimeMode realtime) {
  std::vector<std::uint16_t> ports;
  for (const FloorLaneConfig& lane : lanes) {
    const auto port = start_lane(carrier, lane, realtime);
    if (!port) return unexpected{port.error()};
    ports.push_back(*port);
  }
  if (auto locked = rt::lock_memory(realtime); !locked) return unexpected{locked.error().text()};
  return ports;
}

expected<std::unique_ptr<Caller>, std::string> connect_floor_caller(
    Carrier carrier, const std::string& host, std::uint16_t port, const rt::WaitConfig& wait,
    std::size_t payload_size, bool is_sealed) {
  auto socket = connect_socket(carrier, host, port);
  if (!socket) return unexpected{socket.error()};
  const std::size_t frame_size = floor_frame_size(carrier, payload_size);
  if (carrier == Carrier::kUdp) make_room(socket->handle(), frame_size);
  if (is_sealed) {
    return make_floor_caller(
        frame_size,
        SealedExchange(Frames(carrier, std::move(*socket), wait, kTimeout), frame_size));
  }
  return make_floor_caller(frame_size,
                           SocketExchange{Frames(carrier, std::move(*socket), wait, kTimeout)});
}

expected<std::unique_ptr<Pipeline>, std::string> connect_floor_pipeline(const std::string& host,
                                                                        std::uint16_t port) {
  auto socket = connect_socket(Carrier::kUdp, host, port);
  if (!socket) return unexpected{socket.error()};
  return std::make_unique<FloorPipeline>(std::move(*socket));
}

}  // namespace rtpm::bench
