#include "rtpm/transport/socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include "native_remedies.hpp"
#include "os/native_socket.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/loopback.hpp"
#include "sockets/native.hpp"
#include "sockets/own_host.hpp"

namespace rtpm::transport {

Descriptor::~Descriptor() {
  if (number_ >= 0) os::close(number_);
}

bool is_shortage(int error) noexcept {
  return error == EMFILE || error == ENFILE || error == ENOMEM || error == ENOBUFS;
}

const char* remedy_for_shortage(int error) noexcept {
  switch (error) {
    case EMFILE:
      return os::kRemedyForDescriptors;
    case ENFILE:
      return os::kRemedyForHostsDescriptors;
    default:
      return os::kRemedyForMemory;
  }
}

const char* remedy_for_loopback() {
  const auto own = own_addresses();
  const bool is_up = std::ranges::any_of(
      own, [](const InterfaceAddress& each) { return each.address.is_loopback(); });
  return is_up ? nullptr : os::kRemedyForLoopback;
}

SetupError no_descriptor(const std::string& what, int error) {
  const char* remedy = "see which system calls are allowed here.";
  const char* const loopback = remedy_for_loopback();
  if (error == ENETUNREACH && loopback != nullptr) remedy = loopback;
  if (is_shortage(error)) remedy = remedy_for_shortage(error);
  return {what + " can't be had", error_text(error), remedy, system_error(error)};
}

wire::PeerAddress this_host() noexcept {
  return SocketAddress::of_ipv4(INADDR_LOOPBACK, 0).peer();
}

wire::PeerAddress host_of(int socket) noexcept {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  if (getpeername(socket, generic, &size) != 0) return {};
  if (address.ss_family == AF_INET || address.ss_family == AF_INET6) {
    const auto called = SocketAddress::of(own_address(socket).peer());
    wire::PeerAddress host =
        counted(SocketAddress::of(generic, static_cast<std::size_t>(size)).peer(), called);
    host.port = 0;
    return host;
  }
  const auto peer = os::peer_process(socket);
  return {.low = peer ? peer->process_id : 0};
}

std::optional<std::uint32_t> user_of(int socket) noexcept {
  const auto peer = os::peer_process(socket);
  return peer ? std::optional(peer->user) : std::nullopt;
}

bool is_from_this_host(int socket) noexcept {
  SocketAddress peer;
  socklen_t size = SocketAddress::kSizeMax;
  if (getpeername(socket, native(peer), &size) != 0) return false;
  // A dual-stack socket reports IPv4 addresses as mapped ones.
  const auto address = SocketAddress::of(peer.peer());
  return address.is_loopback() ||
         address.is_same_host(SocketAddress::of(own_address(socket).peer()));
}

SetupError not_served(const std::string& what, int error) {
  const char* const loopback = remedy_for_loopback();
  const char* remedy =
      loopback != nullptr ? loopback : "give an address of this host, such as 127.0.0.1.";
  if (error == EADDRINUSE) {
    remedy = os::kRemedyForBusyPort;
  } else if (error == EACCES) {
    remedy = os::kRemedyForRefusedPort;
  }
  return {what + " can't be served", error_text(error), remedy, system_error(error)};
}

void set_traffic_class(int socket, Priority priority) noexcept {
  constexpr int kDscpShift = 2;
  struct Class {
    int dscp;
    int queue;
  };
  // One class per quarter of the range. SO_PRIORITY above 6 needs a privilege.
  constexpr Class kClasses[] = {{0, 0}, {18, 2}, {34, 4}, {46, 6}};
  const Class chosen = kClasses[priority.value() / ((Priority::kHighest + 1) / 4)];
  const int type_of_service = chosen.dscp << kDscpShift;
  // These also set SO_PRIORITY, so they come first. A dual-stack socket accepts both.
  set_option(socket, IPPROTO_IP, IP_TOS, type_of_service);
  set_option(socket, IPPROTO_IPV6, IPV6_TCLASS, type_of_service);
  os::set_queue(socket, chosen.queue);
}

namespace {

bool wait_for(int descriptor, short events, MonotonicTime until) noexcept {
  const rt::AsleepScope asleep;
  pollfd entry = os::polled(descriptor, events);
  return os::poll_until({&entry, 1}, until) > 0;
}

}  // namespace

bool wait_readable(int descriptor, MonotonicTime until) noexcept {
  return wait_for(descriptor, POLLIN, until);
}

bool wait_writable(int descriptor, MonotonicTime until) noexcept {
  return wait_for(descriptor, POLLOUT, until);
}

void limit_blocking(int socket, Duration time) noexcept {
  os::limit_blocking(socket, time);
}

bool may_block_until(MonotonicTime until, Duration time) noexcept {
  if constexpr (!os::kReceivesMayBlock) return false;
  if (until == kNever) return true;
  const MonotonicTime now = rt::now();
  return until > now && until - now > time + kBlockTimeError;
}

expected<SocketAddress, SetupError> address_to_open(const std::string& host, std::uint16_t port) {
  if (host != kAnyHost) return address_of(host, port);
  const Descriptor trial = os::open_socket(AF_INET6, SOCK_DGRAM, os::Blocking::kYes);
  const SocketAddress both = SocketAddress::of_ipv6({}, 0, 0);
  const bool has_ipv6 = trial.is_open() && bind_to(trial.number(), both) == 0;
  return has_ipv6 ? SocketAddress::of_ipv6({}, 0, port) : SocketAddress::of_ipv4(0, port);
}

void set_dual_stack(int socket, const SocketAddress& address) noexcept {
  if (address.is_ipv4()) return;
  set_option(socket, IPPROTO_IPV6, IPV6_V6ONLY, address.is_unspecified() ? 0 : 1);
}

Descriptor spare_descriptor() noexcept {
  return os::open_socket(AF_INET, SOCK_DGRAM, os::Blocking::kYes);
}

Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept {
  Accepted accepted;
  accepted.socket = os::accept_from(listener, os::Blocking::kNo);
  if (accepted.socket.is_open()) {
    if (!spare.is_open()) spare = spare_descriptor();
    return accepted;
  }
  if (!is_shortage(errno)) return accepted;
  accepted.shortage = errno;
  { const Descriptor closed = std::move(spare); }
  {
    const Descriptor unwanted = os::accept_from(listener, os::Blocking::kYes);
    accepted.still_waits = !unwanted.is_open() && is_shortage(errno);
  }
  spare = spare_descriptor();
  return accepted;
}

}  // namespace rtpm::transport
