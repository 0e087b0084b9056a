#include "rtpm/transport/tcp.hpp"

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cerrno>

#include "sockets/native.hpp"

namespace rtpm::transport {

void prepare_stream(int socket) noexcept {
  set_option(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(socket, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(socket, IPPROTO_TCP, TCP_KEEPIDLE, 5);         // seconds
  set_option(socket, IPPROTO_TCP, TCP_KEEPINTVL, 1);        // seconds
  set_option(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, 3000);  // milliseconds
  set_option(socket, SOL_SOCKET, SO_SNDBUF, 1 << 20);
}

void report_from(int socket, std::size_t size) noexcept {
  set_option(socket, SOL_SOCKET, SO_RCVLOWAT, static_cast<int>(size));
}

std::size_t peek(int socket, MutableBytes to) noexcept {
  const ssize_t size = recv(socket, to.data(), to.size(), MSG_PEEK | MSG_DONTWAIT);
  return size > 0 ? static_cast<std::size_t>(size) : 0;
}

expected<TcpListener, SetupError> TcpListener::open(const std::string& host, std::uint16_t port) {
  const auto address = address_of(host, port);
  if (!address) return unexpected{address.error()};
  const std::string name = host + ":" + std::to_string(port);
  Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.is_open()) return unexpected{no_descriptor("a TCP socket for " + name, errno)};
  // Lets a restarted server have its port while old connections are still ending.
  set_option(socket.number(), SOL_SOCKET, SO_REUSEADDR, 1);
  if (bind(socket.number(), generic(*address), sizeof *address) != 0 ||
      listen(socket.number(), kBacklog) != 0) {
    return unexpected{not_served("TCP " + name, errno)};
  }
  const std::uint16_t bound = ntohs(own_address(socket.number()).sin_port);
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
