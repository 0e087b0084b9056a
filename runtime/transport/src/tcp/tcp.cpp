#include "rtpm/transport/tcp.hpp"

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "sockets/accept.hpp"

namespace rtpm::transport {

void prepare_stream(int socket) noexcept {
  const int on = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  setsockopt(socket, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
  const int idle_s = 5;
  setsockopt(socket, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
  const int interval_s = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
  const int unacknowledged_ms = 3000;
  setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &unacknowledged_ms, sizeof unacknowledged_ms);
  const int buffer_size = 1 << 20;
  setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &buffer_size, sizeof buffer_size);
}

void report_from(int socket, std::size_t size) noexcept {
  const int threshold = static_cast<int>(size);
  setsockopt(socket, SOL_SOCKET, SO_RCVLOWAT, &threshold, sizeof threshold);
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
  // A server that restarts may take its port over from connections that are still ending.
  const int on = 1;
  setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const auto* raw = reinterpret_cast<const sockaddr*>(&*address);
  if (bind(socket.number(), raw, sizeof *address) != 0 || listen(socket.number(), kBacklog) != 0) {
    const int error = errno;
    return setup_error("TCP " + name + " can't be served", system_error(error),
                       remedy_for_bind(error));
  }
  sockaddr_in bound{};
  socklen_t size = sizeof bound;
  getsockname(socket.number(), reinterpret_cast<sockaddr*>(&bound), &size);
  return TcpListener(std::move(socket), ntohs(bound.sin_port));
}

TcpListener::TcpListener(Descriptor socket, std::uint16_t port) noexcept
    : socket_(std::move(socket)), spare_(spare_descriptor()), port_(port) {}

Accepted TcpListener::accept() noexcept {
  Accepted accepted = accept_or_turn_away(socket_.number(), spare_);
  if (accepted.socket.is_open()) prepare_stream(accepted.socket.number());
  return accepted;
}

}  // namespace rtpm::transport
