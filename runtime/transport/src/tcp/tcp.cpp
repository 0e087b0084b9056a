#include "rtpm/transport/tcp.hpp"

#include <cerrno>

#include "os/native_socket.hpp"
#include "rtpm/wire/url.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {

void prepare_stream(int socket) noexcept {
  set_option(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  os::limit_silence(socket);
  set_option(socket, SOL_SOCKET, SO_SNDBUF, 1 << 20);
}

bool report_from(int socket, std::size_t size) noexcept {
  return set_option(socket, SOL_SOCKET, SO_RCVLOWAT, static_cast<int>(size));
}

std::size_t peek(int socket, MutableBytes to) noexcept {
  const std::ptrdiff_t size = recv(socket, to.data(), to.size(), MSG_PEEK | MSG_DONTWAIT);
  return size > 0 ? static_cast<std::size_t>(size) : 0;
}

expected<TcpListener, SetupError> TcpListener::open(const std::string& host, std::uint16_t port) {
  const auto address = address_to_open(host, port);
  if (!address) return unexpected{address.error()};
  const std::string name = wire::host_and_port(host, port);
  Descriptor socket = os::open_socket(address->family(), SOCK_STREAM, os::Blocking::kNo);
  if (!socket.is_open()) return unexpected{no_descriptor("a TCP socket for " + name, errno)};
  os::prepare_listener(socket.number());
  set_dual_stack(socket.number(), *address);
  if (bind_to(socket.number(), *address) != 0 || listen(socket.number(), kBacklog) != 0) {
    return unexpected{not_served("TCP " + name, errno)};
  }
  const std::uint16_t bound = own_address(socket.number()).port();
  return TcpListener(std::move(socket), bound);
}

TcpListener::TcpListener(Descriptor socket, std::uint16_t port) noexcept
    : socket_(std::move(socket)), spare_(spare_descriptor()), port_(port) {}

Accepted TcpListener::accept() noexcept {
  Accepted accepted = accept_or_turn_away(socket_.number(), spare_);
  if (accepted.socket.is_open()) prepare_stream(accepted.socket.number());
  return accepted;
}

}  // namespace rtpm::transport
