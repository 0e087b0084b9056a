#include "rtpm/transport/udp.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "rtpm/wire/header.hpp"
#include "sockets/native.hpp"
#include "udp/segments.hpp"

namespace rtpm::transport {
namespace {

// For a burst of small calls while the lane runs a long one.
constexpr int kReceiveBufferSize = 1 << 20;

// Each call says whether it blocks.
Descriptor make_socket() noexcept {
  return Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
}

// A shared port is open to any process of the same user: a second server on it would silently take
// half of the first one's traffic. So a socket without sharing tries the port first.
// Returns the error number, or 0.
int error_of_trial(const sockaddr_in& address) noexcept {
  const Descriptor trial = make_socket();
  if (!trial.is_open()) return errno;
  return bind(trial.number(), generic(address), sizeof address) == 0 ? 0 : errno;
}

wire::PeerAddress peer_of(const sockaddr_in& address) noexcept {
  return {0, address.sin_addr.s_addr, address.sin_port};
}

sockaddr_in address_of(const wire::PeerAddress& peer) noexcept {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = static_cast<in_port_t>(peer.port);
  address.sin_addr.s_addr = static_cast<in_addr_t>(peer.low);
  return address;
}

// The size of the first frame, by its header.
std::size_t frame_size_in(ConstBytes bytes) noexcept {
  const auto header = wire::decode(bytes);
  return header ? wire::kHeaderSize + header->payload_size : bytes.size();
}

IoError error_of_send(int error) noexcept {
  const bool is_full = error == EAGAIN || error == EWOULDBLOCK || error == ENOBUFS;
  return is_full ? IoError::kFull : IoError::kFailed;
}

SetupError no_socket(const std::string& name) {
  return no_descriptor("a UDP socket for " + name, errno);
}

}  // namespace

std::uint32_t ipv4_of(const wire::PeerAddress& peer) noexcept {
  return ntohl(static_cast<std::uint32_t>(peer.low));
}

expected<UdpPort, SetupError> UdpPort::open(const UdpPortConfig& config) {
  const auto address = address_of(config.host, config.port);
  if (!address) return unexpected{address.error()};
  const std::string name = config.host + ":" + std::to_string(config.port);
  Descriptor socket = make_socket();
  if (!socket.is_open()) return unexpected{no_socket(name)};
  set_option(socket.number(), SOL_SOCKET, SO_REUSEPORT, 1);
  enlarge_receive_buffer(socket.number(), kReceiveBufferSize);
  set_traffic_class(socket.number(), config.priority);
  limit_blocking(socket.number());
  int error = config.joins ? 0 : error_of_trial(*address);
  if (error == 0 && bind(socket.number(), generic(*address), sizeof *address) != 0) error = errno;
  if (is_shortage(error)) return unexpected{no_descriptor("a UDP socket for " + name, error)};
  if (error != 0) return unexpected{not_served("UDP " + name, error)};
  UdpPort opened(std::move(socket), config.low);
  if (!opened.open_waker()) return unexpected{no_socket(name)};
  return opened;
}

bool UdpPort::open_waker() noexcept {
  waker_ = make_socket();
  sockaddr_in own = own_address(socket_.number());
  if (own.sin_addr.s_addr == INADDR_ANY) own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (!waker_.is_open() || connect(waker_.number(), generic(own), sizeof own) != 0) return false;
  waker_peer_ = peer_of(own_address(waker_.number()));
  return true;
}

expected<Datagrams, IoError> UdpPort::receive(MutableBytes buffer) noexcept {
  if (awaited_) return *std::exchange(awaited_, std::nullopt);
  return receive(buffer, MSG_DONTWAIT);
}

bool UdpPort::await(MutableBytes buffer) noexcept {
  if (awaited_) return true;
  if (const auto datagrams = receive(buffer, 0)) awaited_ = *datagrams;
  return awaited_.has_value();
}

expected<Datagrams, IoError> UdpPort::receive(MutableBytes buffer, int flags) noexcept {
  sockaddr_in from{};
  std::size_t each = 0;
  const ssize_t count =
      receive_datagrams(socket_.number(), estimator_.is_on(), buffer, &from, flags, each);
  if (count < 0) {
    const bool is_nothing = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    estimator_.on_nothing();
    return unexpected{is_nothing ? IoError::kNothing : IoError::kFailed};
  }
  const auto size = static_cast<std::size_t>(count);
  // A batch left over from before does not come with its datagrams' size.
  if (estimator_.may_be_left()) each = std::min(each, frame_size_in(buffer.first(size)));
  const wire::PeerAddress peer = peer_of(from);
  if (peer == waker_peer_) {
    ++woken_count_;
    return unexpected{IoError::kNothing};
  }
  return Datagrams{buffer.first(size), each, peer};
}

void UdpPort::note(const Datagrams& datagrams, MonotonicTime received) noexcept {
  using Change = BatchEstimator::Change;
  const auto change = estimator_.on_datagrams(datagrams.peer(), datagrams.are_several(), received);
  if (change != Change::kNone) accept_segments(socket_.number(), change == Change::kBegin);
}

bool UdpPort::wake() noexcept {
  // As much of a header as steer() reads.
  std::array<std::byte, kPriorityOffset + sizeof(std::uint16_t)> call{};
  store_le(call.data() + kPriorityOffset, low_.value());
  // A full socket has datagrams, which wake as well.
  return ::send(waker_.number(), call.data(), call.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

expected<void, IoError> UdpPort::send(const wire::PeerAddress& peer, ConstBytes frame) noexcept {
  const sockaddr_in to = address_of(peer);
  const ssize_t count = sendto(socket_.number(), frame.data(), frame.size(),
                               MSG_DONTWAIT | MSG_NOSIGNAL, generic(to), sizeof to);
  if (count == static_cast<ssize_t>(frame.size())) return {};
  return unexpected{error_of_send(errno)};
}

expected<void, IoError> UdpPort::send_batch(const wire::PeerAddress& peer,
                                            const DatagramBatch& batch) noexcept {
  if (can_send_batches_) {
    const sockaddr_in to = address_of(peer);
    if (send_segments(socket_.number(), &to, batch) >= 0) return {};
    if (!means_no_batches(errno)) return unexpected{error_of_send(errno)};
    can_send_batches_ = false;
  }
  return send_each(batch, [&](ConstBytes frame) { return send(peer, frame); });
}

}  // namespace rtpm::transport
