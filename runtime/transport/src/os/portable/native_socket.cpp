#include "os/native_socket.hpp"

#include <fcntl.h>
#include <sys/select.h>

#include <algorithm>
#include <chrono>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport::os {
namespace {

using std::chrono::milliseconds;

// A child forked meanwhile inherits the socket; POSIX has no other way.
Descriptor prepared(int number, Blocking blocking) noexcept {
  Descriptor socket(number);
  if (!socket.is_open()) return socket;
  fcntl(number, F_SETFD, FD_CLOEXEC);
  const int flags = fcntl(number, F_GETFL);
  fcntl(number, F_SETFL, blocking == Blocking::kYes ? flags & ~O_NONBLOCK : flags | O_NONBLOCK);
#ifdef SO_NOSIGPIPE
  set_option(number, SOL_SOCKET, SO_NOSIGPIPE, 1);
#endif
  return socket;
}

// Waits for less than a millisecond, which poll() can't. Rounds up if select() can't take the
// descriptors.
int wait_briefly(std::span<pollfd> entries, Duration time) noexcept {
  fd_set readable;
  fd_set writable;
  FD_ZERO(&readable);
  FD_ZERO(&writable);
  int number_max = -1;
  for (const pollfd& entry : entries) {
    if (entry.fd >= FD_SETSIZE) return poll(entries.data(), static_cast<nfds_t>(entries.size()), 1);
    if (entry.fd < 0) continue;
    FD_SET(entry.fd, (entry.events & POLLOUT) != 0 ? &writable : &readable);
    number_max = std::max(number_max, entry.fd);
  }
  const timespec left = rt::to_timespec(time);
  if (pselect(number_max + 1, &readable, &writable, nullptr, &left, nullptr) == 0) return 0;
  // Tells which are ready, and in which way.
  return poll(entries.data(), static_cast<nfds_t>(entries.size()), 0);
}

}  // namespace

Descriptor open_socket(int family, int type, Blocking blocking) noexcept {
  return prepared(::socket(family, type, 0), blocking);
}

Descriptor accept_from(int listener, Blocking blocking) noexcept {
  return prepared(::accept(listener, nullptr, nullptr), blocking);
}

int poll_until(std::span<pollfd> entries, MonotonicTime until) noexcept {
  const auto count = static_cast<nfds_t>(entries.size());
  if (until == kNever) return poll(entries.data(), count, -1);
  // The difference to a time far in the past would overflow.
  const MonotonicTime now = until == kAlready ? until : rt::now();
  const Duration left = until > now ? until - now : Duration{0};
  if (left == Duration{0}) return poll(entries.data(), count, 0);
  if (left < milliseconds{1}) return wait_briefly(entries, left);
  // Ends early by less than a millisecond, for which the caller, or this, waits again.
  constexpr Duration kMost = std::chrono::hours{1};
  const auto whole = std::chrono::duration_cast<milliseconds>(std::min(left, kMost));
  const int ready = poll(entries.data(), count, static_cast<int>(whole.count()));
  return ready != 0 ? ready : poll_until(entries, until);
}

// POSIX does not tell it, so no peer of a UNIX socket is trusted.
std::optional<PeerProcess> peer_process(int) noexcept {
  return std::nullopt;
}

void enlarge_receive_buffer(int socket, int size) noexcept {
  set_option(socket, SOL_SOCKET, SO_RCVBUF, size);
}

void set_queue(int, int) noexcept {}

void limit_silence(int stream) noexcept {
  set_option(stream, SOL_SOCKET, SO_KEEPALIVE, 1);
}

std::optional<std::size_t> unacknowledged_size(int) noexcept {
  return std::nullopt;
}

void keep_whole(int) noexcept {}

bool hear_joined_groups_only(int) noexcept {
  return true;
}

}  // namespace rtpm::transport::os
