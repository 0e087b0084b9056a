#pragma once

#include "bsd_sockets.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/socket.hpp"

// Wrappers of socket calls that hide casts and sizes.
namespace rtpm::transport {

/// Calls setsockopt(2); false if the system refuses.
template <class T>
bool set_option(int socket, int level, int option, const T& value) noexcept {
  return setsockopt(socket, level, option, &value, sizeof value) == 0;
}

[[nodiscard]] inline const sockaddr* native(const SocketAddress& address) noexcept {
  return static_cast<const sockaddr*>(address.native());
}
[[nodiscard]] inline sockaddr* native(SocketAddress& address) noexcept {
  return static_cast<sockaddr*>(address.native());
}
[[nodiscard]] inline socklen_t size_of(const SocketAddress& address) noexcept {
  return static_cast<socklen_t>(address.size());
}

[[nodiscard]] inline int bind_to(int socket, const SocketAddress& address) noexcept {
  return bind(socket, native(address), size_of(address));
}
[[nodiscard]] inline int connect_to(int socket, const SocketAddress& address) noexcept {
  return connect(socket, native(address), size_of(address));
}

/// The socket's own address; without a family if it has none.
[[nodiscard]] inline SocketAddress own_address(int socket) noexcept {
  SocketAddress own;
  socklen_t size = SocketAddress::kSizeMax;
  getsockname(socket, native(own), &size);
  return own;
}

/// The host name that means every address of this host.
inline constexpr const char* kAnyHost = "any";

/// Resolves the address to bind a server's port to: `host` is numeric, a name, or kAnyHost, which
/// is both families if this host has IPv6.
[[nodiscard]] expected<SocketAddress, SetupError> address_to_open(const std::string& host,
                                                                  std::uint16_t port);
/// Makes an IPv6 socket accept IPv4 traffic, too, if and only if it is bound to every address.
void set_dual_stack(int socket, const SocketAddress& address) noexcept;

/// How many connections may wait to be accepted; net.core.somaxconn may lower it.
inline constexpr int kBacklog = 1024;

/// A descriptor kept in reserve, to close when no other is left.
[[nodiscard]] Descriptor spare_descriptor() noexcept;

/// Accepts the next connection of a listening socket, non-blocking. If no descriptor is left,
/// closes the connection: it would keep waking its acceptor, and its client would wait needlessly.
/// @param spare  closed temporarily to accept that connection; another thread may take its number
[[nodiscard]] Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept;

}  // namespace rtpm::transport
