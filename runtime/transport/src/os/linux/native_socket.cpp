#include "os/native_socket.hpp"

#include <linux/sockios.h>
#include <netinet/ip.h>
#include <sys/ioctl.h>

#include <algorithm>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport::os {

Descriptor open_socket(int family, int type, Blocking blocking) noexcept {
  const int flags = blocking == Blocking::kYes ? SOCK_CLOEXEC : SOCK_CLOEXEC | SOCK_NONBLOCK;
  return Descriptor(::socket(family, type | flags, 0));
}

Descriptor accept_from(int listener, Blocking blocking) noexcept {
  const int flags = blocking == Blocking::kYes ? SOCK_CLOEXEC : SOCK_CLOEXEC | SOCK_NONBLOCK;
  return Descriptor(::accept4(listener, nullptr, nullptr, flags));
}

// Nanoseconds matter: a lane wakes just before its callers call.
int poll_until(std::span<pollfd> entries, MonotonicTime until) noexcept {
  if (until == kNever) return ppoll(entries.data(), entries.size(), nullptr, nullptr);
  // The difference to a time far in the past would overflow.
  const MonotonicTime now = until == kAlready ? until : rt::now();
  const timespec left = rt::to_timespec(until > now ? until - now : Duration{0});
  return ppoll(entries.data(), entries.size(), &left, nullptr);
}

std::optional<PeerProcess> peer_process(int socket) noexcept {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return std::nullopt;
  return PeerProcess{static_cast<std::uint32_t>(credentials.pid), credentials.uid};
}

void enlarge_receive_buffer(int socket, int size) noexcept {
  if (!set_option(socket, SOL_SOCKET, SO_RCVBUFFORCE, size)) {
    set_option(socket, SOL_SOCKET, SO_RCVBUF, size);
  }
}

void set_queue(int socket, int queue) noexcept {
  set_option(socket, SOL_SOCKET, SO_PRIORITY, queue);
}

void limit_silence(int stream) noexcept {
  set_option(stream, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(stream, IPPROTO_TCP, TCP_KEEPIDLE, 5);         // seconds
  set_option(stream, IPPROTO_TCP, TCP_KEEPINTVL, 1);        // seconds
  set_option(stream, IPPROTO_TCP, TCP_USER_TIMEOUT, 3000);  // milliseconds
}

std::optional<std::size_t> unacknowledged_size(int stream) noexcept {
  int size = 0;
  if (ioctl(stream, SIOCOUTQ, &size) != 0) return std::nullopt;
  return static_cast<std::size_t>(size);
}

void keep_whole(int socket) noexcept {
  set_option(socket, IPPROTO_IP, IP_MTU_DISCOVER, int{IP_PMTUDISC_DO});
  set_option(socket, IPPROTO_IPV6, IPV6_MTU_DISCOVER, int{IPV6_PMTUDISC_DO});
}

bool hear_joined_groups_only(int socket) noexcept {
  return set_option(socket, IPPROTO_IP, IP_MULTICAST_ALL, 0);
}

}  // namespace rtpm::transport::os
