#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include "rtpm/transport/socket.hpp"

// The system's calls on sockets, without casts and sizes.
namespace rtpm::transport {

/// As setsockopt(2); false if the system refuses.
template <class T>
bool set_option(int socket, int level, int option, const T& value) noexcept {
  return setsockopt(socket, level, option, &value, sizeof value) == 0;
}

/// Beyond the system's limit where the process has the right; else the limit applies.
inline void enlarge_receive_buffer(int socket, int size) noexcept {
  if (!set_option(socket, SOL_SOCKET, SO_RCVBUFFORCE, size)) {
    set_option(socket, SOL_SOCKET, SO_RCVBUF, size);
  }
}

[[nodiscard]] inline const sockaddr* generic(const sockaddr_in& address) noexcept {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// The socket's own address; zeros if it has none.
[[nodiscard]] inline sockaddr_in own_address(int socket) noexcept {
  sockaddr_in own{};
  socklen_t size = sizeof own;
  getsockname(socket, reinterpret_cast<sockaddr*>(&own), &size);
  return own;
}

/// How many connections may wait to be accepted, unless net.core.somaxconn is less.
inline constexpr int kBacklog = 1024;

/// A descriptor to close when no other is left.
[[nodiscard]] Descriptor spare_descriptor() noexcept;

/// The next connection of a listening socket, non-blocking. If no descriptor is left the connection
/// is closed: it would keep waking its acceptor, and its client would wait in vain.
/// @param spare  closed for a moment to accept that connection; another thread may take its number
[[nodiscard]] Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept;

}  // namespace rtpm::transport
