#pragma once

// The BSD socket calls as POSIX has them: sockets are ints, buffers are of any type, errors are in
// errno. Handles of kernel objects fit into 32 bits.
#include <winsock2.h>
#include <ws2tcpip.h>

#include <cstddef>
#include <cstdint>
// Windows' headers define plain words.
#undef interface
#undef near
#undef far
#undef small

// Flags that Winsock lacks. Sockets never block here, and sends raise no signal.
#define MSG_DONTWAIT 0x0100'0000
#define MSG_NOSIGNAL 0
#ifdef MSG_TRUNC
#undef MSG_TRUNC
#endif
#define MSG_TRUNC 0x0200'0000

int bind(int socket, const sockaddr* address, socklen_t size) noexcept;
int connect(int socket, const sockaddr* address, socklen_t size) noexcept;
int listen(int socket, int backlog) noexcept;
int getsockname(int socket, sockaddr* address, socklen_t* size) noexcept;
int getpeername(int socket, sockaddr* address, socklen_t* size) noexcept;
int setsockopt(int socket, int level, int option, const void* value, std::size_t size) noexcept;
int getsockopt(int socket, int level, int option, void* value, socklen_t* size) noexcept;
std::ptrdiff_t send(int socket, const void* bytes, std::size_t size, int flags) noexcept;
std::ptrdiff_t sendto(int socket, const void* bytes, std::size_t size, int flags,
                      const sockaddr* address, socklen_t address_size) noexcept;
/// For a datagram that is too long, returns the buffer's size; with MSG_TRUNC, one more.
std::ptrdiff_t recv(int socket, void* bytes, std::size_t size, int flags) noexcept;
std::ptrdiff_t recvfrom(int socket, void* bytes, std::size_t size, int flags, sockaddr* address,
                        socklen_t* address_size) noexcept;

namespace rtpm::transport::os {

/// A limit makes a socket unusable when it has expired.
inline constexpr bool kReceivesMayBlock = false;

[[nodiscard]] inline pollfd polled(int descriptor, short events = POLLIN) noexcept {
  return {static_cast<SOCKET>(descriptor), events, 0};
}
[[nodiscard]] inline int number_of(const pollfd& entry) noexcept {
  return static_cast<int>(entry.fd);
}

/// Starts Winsock, once in a process.
void start_winsock() noexcept;
/// Puts Winsock's last error into errno; returns −1.
int fail() noexcept;

}  // namespace rtpm::transport::os
