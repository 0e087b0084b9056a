#pragma once

// Sockets for tests under the names of POSIX. The calls are those of RTPM's transport.
#include <type_traits>

#include "bsd_sockets.hpp"

#define SOCK_CLOEXEC 0
#define SOCK_NONBLOCK 0

using sa_family_t = ADDRESS_FAMILY;

// Texts, which Winsock's own calls would take as well.
template <class Size>
requires std::is_integral_v<Size> std::ptrdiff_t send(int socket, const char* text, Size size,
                                                      int flags)
noexcept {
  return send(socket, static_cast<const void*>(text), static_cast<std::size_t>(size), flags);
}
template <class Size, class AddressSize>
requires std::is_integral_v<Size> std::ptrdiff_t sendto(int socket, const char* text, Size size,
                                                        int flags, const sockaddr* address,
                                                        AddressSize address_size)
noexcept {
  return sendto(socket, static_cast<const void*>(text), static_cast<std::size_t>(size), flags,
                address, static_cast<socklen_t>(address_size));
}
template <class Size>
requires std::is_integral_v<Size> std::ptrdiff_t recv(int socket, char* text, Size size, int flags)
noexcept {
  return recv(socket, static_cast<void*>(text), static_cast<std::size_t>(size), flags);
}
template <class Size>
requires std::is_integral_v<Size> std::ptrdiff_t recvfrom(int socket, char* text, Size size,
                                                          int flags, sockaddr* address,
                                                          socklen_t* address_size)
noexcept {
  return recvfrom(socket, static_cast<void*>(text), static_cast<std::size_t>(size), flags, address,
                  address_size);
}
