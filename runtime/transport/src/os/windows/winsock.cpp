#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <limits>

#include "bsd_sockets.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {
namespace {

struct Error {
  int winsock;
  int number;
  const char* text;
};
// The C library has no texts for most of these.
constexpr Error kErrors[] = {
    {WSAEWOULDBLOCK, EAGAIN, "The call would wait"},
    {WSAEINTR, EINTR, "The call was interrupted"},
    {WSAEBADF, EBADF, "No such handle"},
    {WSAEACCES, EACCES, "Permission denied"},
    {WSAEFAULT, EFAULT, "Bad address"},
    {WSAEINVAL, EINVAL, "Invalid argument"},
    {WSAEMFILE, EMFILE, "No more sockets are left"},
    {WSAEINPROGRESS, EINPROGRESS, "Operation in progress"},
    {WSAEALREADY, EALREADY, "Connection already in progress"},
    {WSAENOTSOCK, ENOTSOCK, "Not a socket"},
    {WSAEMSGSIZE, EMSGSIZE, "Message too long"},
    {WSAENOPROTOOPT, ENOPROTOOPT, "Unknown option"},
    {WSAEPROTONOSUPPORT, EPROTONOSUPPORT, "Unknown protocol"},
    {WSAEOPNOTSUPP, EOPNOTSUPP, "Not supported"},
    {WSAEAFNOSUPPORT, EAFNOSUPPORT, "This host lacks this kind of address"},
    {WSAEADDRINUSE, EADDRINUSE, "Address already in use"},
    {WSAEADDRNOTAVAIL, EADDRNOTAVAIL, "Cannot assign requested address"},
    {WSAENETDOWN, ENETDOWN, "Network is down"},
    {WSAENETUNREACH, ENETUNREACH, "Network is unreachable"},
    {WSAENETRESET, ENETRESET, "Connection lost by the network"},
    {WSAECONNABORTED, ECONNABORTED, "Connection aborted"},
    {WSAECONNRESET, ECONNRESET, "Connection reset by peer"},
    {WSAENOBUFS, ENOBUFS, "No buffer space is left"},
    {WSAEISCONN, EISCONN, "Already connected"},
    {WSAENOTCONN, ENOTCONN, "Not connected"},
    {WSAETIMEDOUT, ETIMEDOUT, "Connection timed out"},
    {WSAECONNREFUSED, ECONNREFUSED, "Connection refused"},
    {WSAEHOSTUNREACH, EHOSTUNREACH, "No route to host"},
    {ERROR_PORT_UNREACHABLE, ECONNREFUSED, "Connection refused"},
    {WSA_NOT_ENOUGH_MEMORY, ENOMEM, "Not enough memory"},
};

int number_of_error(int winsock) noexcept {
  const auto found = std::ranges::find(kErrors, winsock, &Error::winsock);
  return found != std::end(kErrors) ? found->number : EIO;
}

int outcome_of(int result) noexcept {
  return result == 0 ? 0 : os::fail();
}

char* bytes_of(void* bytes) noexcept {
  return static_cast<char*>(bytes);
}
const char* bytes_of(const void* bytes) noexcept {
  return static_cast<const char*>(bytes);
}
int size_of(std::size_t size) noexcept {
  return static_cast<int>(std::min<std::size_t>(size, std::numeric_limits<int>::max()));
}

constexpr int kOwnFlags = MSG_DONTWAIT | MSG_TRUNC;

std::ptrdiff_t received(int count, std::size_t size, int flags) noexcept {
  if (count >= 0) return count;
  if (WSAGetLastError() != WSAEMSGSIZE) return os::fail();
  return static_cast<std::ptrdiff_t>((flags & MSG_TRUNC) != 0 ? size + 1 : size);
}

}  // namespace

const char* error_text(int error) noexcept {
  const auto found = std::ranges::find(kErrors, error, &Error::number);
  return found != std::end(kErrors) ? found->text : std::strerror(error);
}

namespace os {

void start_winsock() noexcept {
  static const int error = [] {
    WSADATA data{};
    return WSAStartup(MAKEWORD(2, 2), &data);
  }();
  RTPM_ASSERT(error == 0, "Windows has sockets");
}

int fail() noexcept {
  errno = number_of_error(WSAGetLastError());
  return -1;
}

}  // namespace os
}  // namespace rtpm::transport

using namespace rtpm::transport;

int bind(int socket, const sockaddr* address, socklen_t size) noexcept {
  return outcome_of(::bind(static_cast<SOCKET>(socket), address, size));
}

int connect(int socket, const sockaddr* address, socklen_t size) noexcept {
  if (::connect(static_cast<SOCKET>(socket), address, size) == 0) return 0;
  os::fail();
  if (errno == EAGAIN) errno = EINPROGRESS;
  return -1;
}

int listen(int socket, int backlog) noexcept {
  return outcome_of(::listen(static_cast<SOCKET>(socket), backlog));
}

int getsockname(int socket, sockaddr* address, socklen_t* size) noexcept {
  return outcome_of(::getsockname(static_cast<SOCKET>(socket), address, size));
}

int getpeername(int socket, sockaddr* address, socklen_t* size) noexcept {
  return outcome_of(::getpeername(static_cast<SOCKET>(socket), address, size));
}

int setsockopt(int socket, int level, int option, const void* value, std::size_t size) noexcept {
  return outcome_of(
      ::setsockopt(static_cast<SOCKET>(socket), level, option, bytes_of(value), size_of(size)));
}

int getsockopt(int socket, int level, int option, void* value, socklen_t* size) noexcept {
  if (::getsockopt(static_cast<SOCKET>(socket), level, option, bytes_of(value), size) != 0)
    return os::fail();
  if (level == SOL_SOCKET && option == SO_ERROR) {
    int& error = *static_cast<int*>(value);
    if (error != 0) error = number_of_error(error);
  }
  return 0;
}

std::ptrdiff_t send(int socket, const void* bytes, std::size_t size, int flags) noexcept {
  const int count =
      ::send(static_cast<SOCKET>(socket), bytes_of(bytes), size_of(size), flags & ~kOwnFlags);
  return count >= 0 ? count : os::fail();
}

std::ptrdiff_t sendto(int socket, const void* bytes, std::size_t size, int flags,
                      const sockaddr* address, socklen_t address_size) noexcept {
  const int count = ::sendto(static_cast<SOCKET>(socket), bytes_of(bytes), size_of(size),
                             flags & ~kOwnFlags, address, address_size);
  return count >= 0 ? count : os::fail();
}

std::ptrdiff_t recv(int socket, void* bytes, std::size_t size, int flags) noexcept {
  const int count =
      ::recv(static_cast<SOCKET>(socket), bytes_of(bytes), size_of(size), flags & ~kOwnFlags);
  return received(count, size, flags);
}

std::ptrdiff_t recvfrom(int socket, void* bytes, std::size_t size, int flags, sockaddr* address,
                        socklen_t* address_size) noexcept {
  const int count = ::recvfrom(static_cast<SOCKET>(socket), bytes_of(bytes), size_of(size),
                               flags & ~kOwnFlags, address, address_size);
  return received(count, size, flags);
}
