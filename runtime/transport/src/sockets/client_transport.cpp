#include "rtpm/transport/client_transport.hpp"

#include <array>
#include <cerrno>

#include "native_remedies.hpp"
#include "os/native_socket.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/loopback.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"
#include "sockets/native.hpp"
#include "udp/segments.hpp"

namespace rtpm::transport {
namespace {

// How long a caller waits for space in a stream's buffer before it gives up on the peer.
constexpr Duration kSendPatience = std::chrono::milliseconds{100};

SetupError no_socket(const std::string& host, std::uint16_t port, int error) {
  return no_descriptor("a socket to reach " + wire::host_and_port(host, port), error);
}

// UDP's connect() contacts no peer; it fails only if there is no route.
SetupError not_reached(const std::string& host, std::uint16_t port, int error) {
  if (is_shortage(error)) return no_socket(host, port, error);
  const auto address = SocketAddress::parse(host, port);
  const char* const loopback = address && address->is_loopback() ? remedy_for_loopback() : nullptr;
  return {wire::host_and_port(host, port) + " can't be reached over UDP", error_text(error),
          loopback != nullptr ? loopback : os::kRemedyForRoute, system_error(error)};
}

SetupError no_answer(std::string_view protocol, const std::string& host, std::uint16_t port,
                     int error) {
  return {"no server answers at " + std::string(protocol) + " " + wire::host_and_port(host, port),
          error_text(error), "start the server, or check host and port", system_error(error)};
}

// Whether the system gave the socket the same port that it connects to, which can happen if no
// server has that port: the socket would talk to itself.
bool is_its_own_peer(int socket, const SocketAddress& peer) noexcept {
  return own_address(socket) == peer;
}

class UdpTransport final : public ClientTransport {
 public:
  UdpTransport(Descriptor socket, bool is_on_host) noexcept
      : socket_(std::move(socket)), is_on_host_(is_on_host) {
    if (is_on_host) limit_blocking(socket_.number(), kBlockTimeShort);
  }

  expected<void, IoError> send(ConstBytes frame) noexcept override {
    const std::ptrdiff_t count =
        ::send(socket_.number(), frame.data(), frame.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count >= 0) return {};
    return unexpected{error_of(errno)};
  }
  expected<void, IoError> send_batch(const DatagramBatch& batch) noexcept override {
    if (can_send_batches_) {
      if (send_segments(socket_.number(), nullptr, nullptr, batch) >= 0) return {};
      if (!means_no_batches(errno)) return unexpected{error_of(errno)};
      can_send_batches_ = false;
    }
    return ClientTransport::send_batch(batch);
  }
  void accept_batches() noexcept override {
    if (!batch_buffer_.bytes().empty()) return;
    batch_buffer_ = rt::LazyMemory(Datagrams::kSizeMax);
    if (!batch_buffer_.bytes().empty()) accept_segments(socket_.number(), true);
  }

  expected<MutableBytes, IoError> receive() noexcept override { return receive(MSG_DONTWAIT); }
  bool has_buffered() const noexcept override { return !received_.is_empty(); }
  expected<MutableBytes, IoError> await(MonotonicTime until) noexcept override {
    if (has_buffered()) return receive();
    if (!is_on_host_ || !may_block_until(until, kBlockTimeShort))
      return ClientTransport::await(until);
    const rt::AsleepScope asleep;
    return receive(0);
  }

  int descriptor() const noexcept override { return socket_.number(); }
  wire::Medium medium() const noexcept override { return wire::Medium::kDatagram; }
  bool is_on_host() const noexcept override { return is_on_host_; }

 private:
  expected<MutableBytes, IoError> receive(int flags) noexcept {
    if (received_.is_empty()) {
      const bool takes_batches = !batch_buffer_.bytes().empty();
      const MutableBytes buffer = takes_batches ? batch_buffer_.bytes() : MutableBytes(buffer_);
      std::size_t each = 0;
      const std::ptrdiff_t count =
          receive_datagrams(socket_.number(), takes_batches, buffer, nullptr, nullptr, flags, each);
      if (count < 0) return unexpected{error_of(errno)};
      received_ = Datagrams{buffer.first(static_cast<std::size_t>(count)), each, {}};
    }
    return received_.next().value_or(MutableBytes{});
  }
  static IoError error_of(int error) noexcept {
    switch (error) {
      case EAGAIN:
      case EINTR:
        return IoError::kNothing;
      case ENOBUFS:
        return IoError::kFull;
      case ECONNREFUSED:
      case ECONNRESET:  // Windows.
        return IoError::kRefused;
      default:
        return IoError::kFailed;
    }
  }

  Descriptor socket_;
  bool is_on_host_;
  bool can_send_batches_ = true;
  rt::LazyMemory batch_buffer_;  ///< Empty unless it receives batches.
  Datagrams received_;
  // One byte more than the largest frame, to detect larger datagrams.
  alignas(64) std::array<std::byte, wire::kDatagramFrameSizeMax + 1> buffer_{};
};

class TcpTransport final : public ClientTransport {
 public:
  TcpTransport(Descriptor socket, std::uint32_t message_size_max)
      : stream_(std::move(socket), message_size_max) {}

  expected<void, IoError> send(ConstBytes frame) noexcept override {
    return stream_.send(frame, rt::now() + kSendPatience);
  }
  expected<MutableBytes, IoError> receive() noexcept override { return stream_.receive(); }
  bool has_buffered() const noexcept override { return stream_.has_buffered(); }
  expected<MutableBytes, IoError> await(MonotonicTime until) noexcept override {
    // No poll would report a buffered frame.
    if (stream_.has_buffered()) return stream_.receive();
    if (!may_block_until(until)) return ClientTransport::await(until);
    const rt::AsleepScope asleep;
    return stream_.await();
  }
  int descriptor() const noexcept override { return stream_.descriptor(); }
  wire::Medium medium() const noexcept override { return wire::Medium::kStream; }

 private:
  FrameStream stream_;
};

// Whether the frames of a connected socket stay on this host.
bool is_on_host(int socket, const SocketAddress& peer) noexcept {
  return peer.is_loopback() || own_address(socket).is_same_host(peer);
}

// Waits until a connection is established; returns 0 or the error number.
int finish_connecting(int socket, MonotonicTime deadline) noexcept {
  while (!wait_writable(socket, deadline)) {
    if (rt::now() >= deadline) return ETIMEDOUT;
  }
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

}  // namespace

expected<void, IoError> ClientTransport::send_batch(const DatagramBatch& batch) noexcept {
  return send_each(batch, [&](ConstBytes frame) { return send(frame); });
}

void ClientTransport::wait(MonotonicTime until) noexcept {
  wait_readable(descriptor(), until);
}

expected<MutableBytes, IoError> ClientTransport::await(MonotonicTime until) noexcept {
  wait(until);
  return receive();
}

expected<std::unique_ptr<ClientTransport>, SetupError> open_udp_transport(const std::string& host,
                                                                          std::uint16_t port,
                                                                          Priority priority) {
  const auto address = address_of(host, port);
  if (!address) return unexpected{address.error()};
  Descriptor socket = os::open_socket(address->family(), SOCK_DGRAM, os::Blocking::kNo);
  if (!socket.is_open()) return unexpected{no_socket(host, port, errno)};
  // Connected, so that the system looks up the route only once and reports a closed port.
  if (connect_to(socket.number(), *address) != 0) {
    return unexpected{not_reached(host, port, errno)};
  }
  if (is_its_own_peer(socket.number(), *address)) {
    return unexpected{no_answer("UDP", host, port, ECONNREFUSED)};
  }
  os::keep_whole(socket.number());
  set_traffic_class(socket.number(), priority);
  const bool stays_here = is_on_host(socket.number(), *address);
  return std::unique_ptr<ClientTransport>(
      std::make_unique<UdpTransport>(std::move(socket), stays_here));
}

expected<std::unique_ptr<ClientTransport>, SetupError> open_tcp_transport(
    const std::string& host, std::uint16_t port, Priority priority, std::uint32_t message_size_max,
    MonotonicTime deadline) {
  const auto address = address_of(host, port);
  if (!address) return unexpected{address.error()};
  Descriptor socket = os::open_socket(address->family(), SOCK_STREAM, os::Blocking::kNo);
  if (!socket.is_open()) return unexpected{no_socket(host, port, errno)};
  set_traffic_class(socket.number(), priority);
  prepare_stream(socket.number());
  int error = 0;
  if (connect_to(socket.number(), *address) != 0) {
    error = errno == EINPROGRESS ? finish_connecting(socket.number(), deadline) : errno;
  }
  if (is_shortage(error)) return unexpected{no_socket(host, port, error)};
  if (error == 0 && is_its_own_peer(socket.number(), *address)) error = ECONNREFUSED;
  if (error != 0) return unexpected{no_answer("TCP", host, port, error)};
  return std::unique_ptr<ClientTransport>(
      std::make_unique<TcpTransport>(std::move(socket), message_size_max));
}

}  // namespace rtpm::transport
