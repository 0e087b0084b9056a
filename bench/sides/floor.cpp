#include "sides/floor.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};

using Frame = std::vector<std::byte>;

/// Owns a socket.
class Socket {
 public:
  explicit Socket(int handle = -1) noexcept : handle_(handle) {}
  Socket(Socket&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Socket() {
    if (handle_ >= 0) close(handle_);
  }
  [[nodiscard]] int handle() const noexcept { return handle_; }
  [[nodiscard]] int release() noexcept { return std::exchange(handle_, -1); }

 private:
  int handle_;
};

sockaddr_in address_of(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = inet_addr(host.c_str());
  return address;
}

std::string system_text(std::string_view what) {
  return "the raw floor's " + std::string(what) + " failed: " + std::strerror(errno);
}

Socket open_socket(Carrier carrier) {
  return Socket(socket(AF_INET, carrier == Carrier::kUdp ? SOCK_DGRAM : SOCK_STREAM, 0));
}

void send_at_once(int handle) {
  const int on = 1;
  setsockopt(handle, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

/// Receives with a wait strategy. A stream may give less than a frame.
class Receiver {
 public:
  /// `give_up`: after which a spinning receiver fails; one that blocks has its socket's time-out.
  Receiver(int handle, const rt::WaitConfig& wait, Duration give_up) noexcept
      : handle_(handle), strategy_(wait.strategy) {
    if (strategy_ == rt::WaitStrategy::kAdaptive) spin_ = wait.spin;
    // Nothing raw predicts its callers; what would be as quick as that spins.
    if (strategy_ == rt::WaitStrategy::kPeriodic) strategy_ = rt::WaitStrategy::kSpin;
    if (strategy_ == rt::WaitStrategy::kSpin) spin_ = give_up;
  }

  /// @return the bytes received, or -1 with errno set as recv() does.
  ssize_t receive(MutableBytes frame, sockaddr_in* from) const noexcept {
    if (spin_ > Duration{0}) {
      const MonotonicTime end = spin_ == Duration::max() ? kNever : rt::now() + spin_;
      do {
        const ssize_t got = take(frame, from, MSG_DONTWAIT);
        if (got >= 0 || (errno != EAGAIN && errno != EINTR)) return got;
      } while (end == kNever || rt::now() < end);
      if (strategy_ == rt::WaitStrategy::kSpin) return -1;
    }
    return take(frame, from, 0);
  }

 private:
  ssize_t take(MutableBytes frame, sockaddr_in* from, int flags) const noexcept {
    if (from == nullptr) return recv(handle_, frame.data(), frame.size(), flags);
    socklen_t from_size = sizeof *from;
    return recvfrom(handle_, frame.data(), frame.size(), flags, reinterpret_cast<sockaddr*>(from),
                    &from_size);
  }

  int handle_;
  rt::WaitStrategy strategy_;
  Duration spin_{0};
};

/// Completes a frame of which a stream gave `got` bytes.
bool receive_rest(int handle, Frame& frame, ssize_t got) noexcept {
  while (got > 0 && static_cast<std::size_t>(got) < frame.size()) {
    const auto have = static_cast<std::size_t>(got);
    const ssize_t more = recv(handle, frame.data() + have, frame.size() - have, MSG_WAITALL);
    if (more <= 0) return false;
    got += more;
  }
  return got > 0;
}

/// Completes a frame of which a first datagram of `got` bytes came.
bool receive_datagrams(const Receiver& receiver, Frame& frame, ssize_t got) noexcept {
  while (got > 0 && static_cast<std::size_t>(got) < frame.size()) {
    const ssize_t more =
        receiver.receive(MutableBytes(frame).subspan(static_cast<std::size_t>(got)), nullptr);
    if (more <= 0) return false;
    got += more;
  }
  return got > 0;
}

/// Sends a frame as datagrams, to `to` or to where the socket is connected.
bool send_datagrams(int handle, const Frame& frame, const sockaddr_in* to) noexcept {
  for (std::size_t done = 0; done < frame.size(); done += wire::kDatagramFrameSizeMax) {
    const std::size_t size = std::min(wire::kDatagramFrameSizeMax, frame.size() - done);
    const ssize_t sent =
        sendto(handle, frame.data() + done, size, MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(to), to == nullptr ? 0 : sizeof *to);
    if (sent < 0) return false;
  }
  return true;
}

/// Has a socket hold a whole frame, whose datagrams the kernel counts at more than their bytes.
void make_room(int handle, std::size_t frame_size) noexcept {
  if (frame_size <= wire::kDatagramFrameSizeMax) return;
  const int size = static_cast<int>(4 * frame_size);
  if (setsockopt(handle, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) != 0)
    setsockopt(handle, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
}

void compute_as_asked(const Frame& frame) noexcept {
  const auto duration_ns = load_le<std::uint64_t>(frame.data());
  if (duration_ns != 0) compute_for(Duration{static_cast<Duration::rep>(duration_ns)});
}

// ---- serving ------------------------------------------------------------------------------------

void serve_udp(int handle, const rt::WaitConfig& wait, std::size_t frame_size) {
  const Receiver receiver(handle, wait, Duration::max());
  make_room(handle, frame_size);
  Frame frame(frame_size);
  sockaddr_in from{};
  for (;;) {
    const ssize_t size = receiver.receive(frame, &from);
    if (size < 0 || !receive_datagrams(receiver, frame, size)) continue;
    compute_as_asked(frame);
    send_datagrams(handle, frame, &from);
  }
}

bool serve_tcp_frame(int handle, Frame& frame, ssize_t got) noexcept {
  if (got <= 0 || !receive_rest(handle, frame, got)) return false;
  compute_as_asked(frame);
  return send(handle, frame.data(), frame.size(), MSG_NOSIGNAL) > 0;
}

void serve_tcp_one(int handle, const rt::WaitConfig& wait, std::size_t frame_size) {
  const Receiver receiver(handle, wait, Duration::max());
  Frame frame(frame_size);
  while (serve_tcp_frame(handle, frame, receiver.receive(frame, nullptr))) {
  }
}

void serve_tcp_many(std::vector<pollfd> connections, std::size_t frame_size) {
  Frame frame(frame_size);
  while (poll(connections.data(), connections.size(), -1) > 0) {
    for (pollfd& connection : connections) {
      if (connection.revents == 0) continue;
      const ssize_t got = recv(connection.fd, frame.data(), frame.size(), 0);
      // A negative number tells poll() to leave a connection that ended alone.
      if (!serve_tcp_frame(connection.fd, frame, got)) connection.fd = -1;
    }
  }
}

void serve_tcp(int listener, const FloorLaneConfig& lane) {
  const std::size_t frame_size = floor_frame_size(Carrier::kTcp, lane.payload_size);
  std::vector<Socket> sockets;
  std::vector<pollfd> connections;
  for (int i = 0; i < lane.connection_count; ++i) {
    sockets.emplace_back(accept(listener, nullptr, nullptr));
    send_at_once(sockets.back().handle());
    connections.push_back({.fd = sockets.back().handle(), .events = POLLIN, .revents = 0});
  }
  if (connections.size() == 1) {
    serve_tcp_one(connections.front().fd, lane.wait, frame_size);
  } else {
    serve_tcp_many(std::move(connections), frame_size);
  }
}

/// Opens a lane's socket and starts its thread; gives back its port. Neither is ever closed: the
/// process is a server until it ends.
expected<std::uint16_t, std::string> start_lane(Carrier carrier, const FloorLaneConfig& lane,
                                                rt::RealtimeMode realtime) {
  const int handle = open_socket(carrier).release();
  sockaddr_in address = address_of(lane.host, 0);
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  if (bind(handle, generic, size) != 0 || getsockname(handle, generic, &size) != 0 ||
      (carrier == Carrier::kTcp && listen(handle, 64) != 0)) {
    return unexpected{system_text("socket")};
  }
  auto thread = rt::Thread::start(
      {.name = lane.name, .priority = lane.priority, .cpus = {lane.cpu}, .realtime = realtime},
      [handle, carrier, lane] {
        carrier == Carrier::kUdp
            ? serve_udp(handle, lane.wait, floor_frame_size(carrier, lane.payload_size))
            : serve_tcp(handle, lane);
      });
  if (!thread) return unexpected{thread.error().text()};
  static auto& started = *new std::vector<rt::Thread>;
  started.push_back(std::move(*thread));
  return ntohs(address.sin_port);
}

// ---- calling ------------------------------------------------------------------------------------

class FloorCaller final : public Caller {
 public:
  FloorCaller(Carrier carrier, Socket socket, const rt::WaitConfig& wait, std::size_t payload_size)
      : carrier_(carrier),
        socket_(std::move(socket)),
        receiver_(socket_.handle(), wait, kTimeout),
        sent_(floor_frame_size(carrier, payload_size)),
        received_(sent_.size()) {
    for (std::size_t i = wire::kHeaderSize; i < sent_.size(); ++i) {
      sent_[i] = static_cast<std::byte>(i);
    }
  }

  expected<void, std::string> echo() override { return exchange(); }

  expected<void, std::string> work(Duration duration) override {
    store_le(sent_.data(), static_cast<std::uint64_t>(duration.count()));
    auto outcome = exchange();
    store_le(sent_.data(), std::uint64_t{0});
    return outcome;
  }

 private:
  expected<void, std::string> exchange() {
    if (!send_frame()) return unexpected{system_text("send")};
    const ssize_t got = receiver_.receive(received_, nullptr);
    const bool is_whole = carrier_ == Carrier::kTcp ? receive_rest(socket_.handle(), received_, got)
                                                    : receive_datagrams(receiver_, received_, got);
    if (!is_whole) return unexpected{system_text("receive")};
    if (!are_same(received_, sent_)) return unexpected{std::string("the raw floor's echo differs")};
    return {};
  }

  [[nodiscard]] bool send_frame() const noexcept {
    if (carrier_ == Carrier::kUdp) return send_datagrams(socket_.handle(), sent_, nullptr);
    return send(socket_.handle(), sent_.data(), sent_.size(), MSG_NOSIGNAL) >= 0;
  }

  Carrier carrier_;
  Socket socket_;
  Receiver receiver_;
  Frame sent_;
  Frame received_;
};

class FloorPipeline final : public Pipeline {
 public:
  FloorPipeline(Socket socket, std::size_t in_flight)
      : socket_(std::move(socket)), in_flight_(in_flight) {
    for (std::size_t i = wire::kHeaderSize; i < sent_.size(); ++i)
      sent_[i] = static_cast<std::byte>(i);
  }

  expected<void, std::string> run(std::uint64_t count) override {
    std::uint64_t begun = 0;
    for (std::uint64_t taken = 0; taken < count; ++taken) {
      for (; begun < std::min<std::uint64_t>(count, taken + in_flight_); ++begun) {
        if (send(socket_.handle(), sent_.data(), sent_.size(), MSG_NOSIGNAL) < 0) {
          return unexpected{system_text("send")};
        }
      }
      if (recv(socket_.handle(), received_.data(), received_.size(), 0) < 0) {
        return unexpected{system_text("receive")};
      }
      if (!are_same(received_, sent_))
        return unexpected{std::string("the raw floor's echo differs")};
    }
    return {};
  }

 private:
  Socket socket_;
  std::size_t in_flight_;
  Frame sent_ = Frame(kFloorFrameSize);
  Frame received_ = Frame(kFloorFrameSize);
};

expected<Socket, std::string> connect_socket(Carrier carrier, const std::string& host,
                                             std::uint16_t port) {
  Socket socket = open_socket(carrier);
  const sockaddr_in address = address_of(host, port);
  if (connect(socket.handle(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return unexpected{system_text("connect")};
  }
  if (carrier == Carrier::kTcp) send_at_once(socket.handle());
  // Nothing waits without end: a blocked receive gives up, too.
  const timeval timeout{.tv_sec = kTimeout.count() / 1'000'000'000, .tv_usec = 0};
  setsockopt(socket.handle(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  return socket;
}

}  // namespace

std::size_t floor_frame_size(Carrier carrier, std::size_t payload_size) noexcept {
  if (carrier != Carrier::kUdp) return wire::kHeaderSize + payload_size;
  const std::size_t datagram_count = std::max<std::size_t>(
      1, (payload_size + wire::kDatagramPayloadSizeMax - 1) / wire::kDatagramPayloadSizeMax);
  return datagram_count * wire::kHeaderSize + payload_size;
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

expected<std::unique_ptr<Caller>, std::string> connect_floor_caller(Carrier carrier,
                                                                    const std::string& host,
                                                                    std::uint16_t port,
                                                                    const rt::WaitConfig& wait,
                                                                    std::size_t payload_size) {
  auto socket = connect_socket(carrier, host, port);
  if (!socket) return unexpected{socket.error()};
  if (carrier == Carrier::kUdp)
    make_room(socket->handle(), floor_frame_size(carrier, payload_size));
  return std::unique_ptr<Caller>(
      std::make_unique<FloorCaller>(carrier, std::move(*socket), wait, payload_size));
}

expected<std::unique_ptr<Pipeline>, std::string> connect_floor_pipeline(const std::string& host,
                                                                        std::uint16_t port,
                                                                        std::size_t in_flight) {
  auto socket = connect_socket(Carrier::kUdp, host, port);
  if (!socket) return unexpected{socket.error()};
  return std::unique_ptr<Pipeline>(std::make_unique<FloorPipeline>(std::move(*socket), in_flight));
}

}  // namespace rtpm::bench
