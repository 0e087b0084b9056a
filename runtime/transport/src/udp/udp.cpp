#include "rtpm/transport/udp.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/url.hpp"
#include "sockets/native.hpp"
#include "sockets/own_host.hpp"
#include "udp/distributor.hpp"
#include "udp/segments.hpp"

namespace rtpm::transport {
namespace {

// Holds a burst of small calls while the lane runs a long one.
constexpr int kReceiveBufferSize = 1 << 20;

// The socket is blocking; each call decides by its flags.
Descriptor make_socket(int family) noexcept {
  return os::open_socket(family, SOCK_DGRAM, os::Blocking::kYes);
}

// A shared port is open to any process of the same user: a second server on it would silently take
// half of the first one's traffic. So an unshared socket tries the port first. Returns the error
// number, or 0.
int error_of_trial(const SocketAddress& address) noexcept {
  const Descriptor trial = make_socket(address.family());
  if (!trial.is_open()) return errno;
  set_dual_stack(trial.number(), address);
  return bind_to(trial.number(), address) == 0 ? 0 : errno;
}

// The size of the first frame, from its header.
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

UdpPort::UdpPort(Descriptor socket, const SocketAddress& own, const UdpPortConfig& config)
    : socket_(std::move(socket)),
      low_(config.low),
      own_(own),
      index_(std::uint32_t{config.index} << kLocalShift) {
  if (own.is_unspecified()) locals_ = std::make_unique<LocalAddresses>();
}

expected<UdpPort, SetupError> UdpPort::open(const UdpPortConfig& config) {
  return open(config, /*joins=*/false);
}

expected<UdpPort, SetupError> UdpPort::open(const UdpPortConfig& config, bool joins) {
  const auto address = address_to_open(config.host, config.port);
  if (!address) return unexpected{address.error()};
  const std::string name = wire::host_and_port(config.host, config.port);
  Descriptor socket = make_socket(address->family());
  if (!socket.is_open()) return unexpected{no_socket(name)};
  os::prepare_server_port(socket.number());
  os::enlarge_receive_buffer(socket.number(), kReceiveBufferSize);
  set_traffic_class(socket.number(), config.priority);
  set_dual_stack(socket.number(), *address);
  limit_blocking(socket.number());
  int error = joins ? 0 : error_of_trial(*address);
  if (error == 0 && address->is_unspecified() && !receive_destinations(socket.number(), *address)) {
    error = errno;
  }
  if (error == 0 && bind_to(socket.number(), *address) != 0) error = errno;
  if (is_shortage(error)) return unexpected{no_descriptor("a UDP socket for " + name, error)};
  if (error != 0) return unexpected{not_served("UDP " + name, error)};
  UdpPort opened(std::move(socket), *address, config);
  if (!opened.open_waker()) return unexpected{no_socket(name)};
  return opened;
}

int UdpPort::descriptor() const noexcept {
  return inbox_ ? inbox_->descriptor() : socket_.number();
}

bool UdpPort::open_waker() noexcept {
  waker_ = make_socket(own_.family());
  SocketAddress own = own_address(socket_.number());
  if (own.is_unspecified()) {
    own = SocketAddress::of_ipv4(INADDR_LOOPBACK, own.port()).for_family(own_.family());
  }
  if (!waker_.is_open()) return false;
  // An IPv4 address in mapped form, too.
  if (!own.is_ipv4()) set_option(waker_.number(), IPPROTO_IPV6, IPV6_V6ONLY, 0);
  if (connect_to(waker_.number(), own) != 0) return false;
  waker_peer_ = own_address(waker_.number()).peer();
  return true;
}

// The index in locals_ of the address at which a datagram arrived.
std::uint32_t UdpPort::index_of_local(const SocketAddress& to) noexcept {
  LocalAddresses& locals = *locals_;
  for (std::uint32_t i = 1; i < local_count_; ++i) {
    if (locals[i].is_same_host(to)) return i;
  }
  if (local_count_ == locals.size() || to.family() == AF_UNSPEC) return 0;
  locals[local_count_] = to;
  return local_count_++;
}

const SocketAddress& UdpPort::local_of(const wire::PeerAddress& peer) const noexcept {
  return locals_ ? (*locals_)[index_of(peer)] : own_;
}

wire::PeerAddress UdpPort::host_of(const wire::PeerAddress& peer) const noexcept {
  const auto address = SocketAddress::of(peer);
  const bool is_here = address.is_loopback() || address.is_same_host(local_of(peer));
  return is_here ? this_host() : peer;
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
  SocketAddress from;
  SocketAddress to;
  std::size_t each = 0;
  const bool is_any = locals_ != nullptr;
  const std::ptrdiff_t count = inbox_
                                   ? inbox_->take(buffer, from, to, flags == 0, each)
                                   : receive_datagrams(socket_.number(), estimator_.is_on(), buffer,
                                                       &from, is_any ? &to : nullptr, flags, each);
  if (count < 0) {
    const bool is_nothing = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    estimator_.on_nothing();
    return unexpected{is_nothing ? IoError::kNothing : IoError::kFailed};
  }
  const auto size = static_cast<std::size_t>(count);
  // A batch left over from before does not include its datagrams' size.
  if (estimator_.may_be_left()) each = std::min(each, frame_size_in(buffer.first(size)));
  wire::PeerAddress peer = from.peer();
  if (peer == waker_peer_) {
    ++woken_count_;
    return unexpected{IoError::kNothing};
  }
  peer.port |= is_any ? index_of_local(to) << kLocalShift : index_;
  return Datagrams{buffer.first(size), each, counted(peer, local_of(peer))};
}

void UdpPort::note(const Datagrams& datagrams, MonotonicTime received) noexcept {
  if (inbox_) return;  // Its datagrams are handed out singly.
  using Change = BatchEstimator::Change;
  const auto change = estimator_.on_datagrams(datagrams.peer(), datagrams.are_several(), received);
  if (change != Change::kNone) accept_segments(socket_.number(), change == Change::kBegin);
}

bool UdpPort::wake() noexcept {
  // The part of a header that steer() reads.
  std::array<std::byte, kPriorityOffset + sizeof(std::uint16_t)> call{};
  store_le(call.data() + kPriorityOffset, low_.value());
  // If the socket is full, its datagrams wake the receiver as well.
  return ::send(waker_.number(), call.data(), call.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

expected<void, IoError> UdpPort::send(const wire::PeerAddress& peer, ConstBytes frame) noexcept {
  const auto to = SocketAddress::of(peer);
  const std::ptrdiff_t count =
      own_.is_ipv4() && !locals_
          ? sendto(socket_.number(), frame.data(), frame.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                   native(to), sizeof(sockaddr_in))
          : send_as_asked(to.for_family(own_.family()), local_of(peer), frame);
  if (count == static_cast<std::ptrdiff_t>(frame.size())) return {};
  return unexpected{error_of_send(errno)};
}

// Sends from the address that the peer called.
std::ptrdiff_t UdpPort::send_as_asked(const SocketAddress& to, const SocketAddress& local,
                                      ConstBytes frame) noexcept {
  if (locals_ && local.family() != AF_UNSPEC) return send_from(socket_.number(), to, local, frame);
  return sendto(socket_.number(), frame.data(), frame.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                native(to), size_of(to));
}

expected<void, IoError> UdpPort::send_batch(const wire::PeerAddress& peer,
                                            const DatagramBatch& batch) noexcept {
  if (can_send_batches_) {
    const auto to = SocketAddress::of(peer).for_family(own_.family());
    const SocketAddress& local = local_of(peer);
    const bool has_local = locals_ && local.family() != AF_UNSPEC;
    if (send_segments(socket_.number(), &to, has_local ? &local : nullptr, batch) >= 0) return {};
    if (!means_no_batches(errno)) return unexpected{error_of_send(errno)};
    can_send_batches_ = false;
  }
  return send_each(batch, [&](ConstBytes frame) { return send(peer, frame); });
}

}  // namespace rtpm::transport
