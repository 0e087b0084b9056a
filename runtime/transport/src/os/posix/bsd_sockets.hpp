#pragma once

// The BSD socket calls under the names that every system has for them.
#include <arpa/inet.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

// Where a send to an ended stream raises no signal, or the socket says so (os::open_socket).
#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0
#endif

namespace rtpm::transport::os {

/// Whether a receive can wait for a limited time.
inline constexpr bool kReceivesMayBlock = true;

/// An entry for poll_until(), and its descriptor.
[[nodiscard]] inline pollfd polled(int descriptor, short events = POLLIN) noexcept {
  return {descriptor, events, 0};
}
[[nodiscard]] inline int number_of(const pollfd& entry) noexcept {
  return entry.fd;
}

}  // namespace rtpm::transport::os
