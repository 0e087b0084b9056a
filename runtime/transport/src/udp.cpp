#include "rtpm/transport/udp.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>

namespace rtpm::transport {
namespace {

// Room for a burst of small calls while the lane runs a long one.
constexpr int kReceiveBufferSize = 1 << 20;

Descriptor make_socket() noexcept {
  return Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

// With a shared port the system lets any process of the same user join, so that a second server on
// the same port would quietly take half of the first one's traffic. A trial without sharing tells.
bool is_free(const sockaddr_in& address) noexcept {
  const Descriptor trial = make_socket();
  return bind(trial.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

}  // namespace

expected<UdpPort, TransportError> UdpPort::open(const std::string& host, std::uint16_t port,
                                                Priority priority, bool joins) {
  const auto address = address_of(host, port);
  if (!address) return unexpected{address.error()};
  const std::string name = host + ":" + std::to_string(port);
  Descriptor socket = make_socket();
  if (!socket.is_open()) {
    return unexpected{TransportError{"no UDP socket for " + name + " (" + std::strerror(errno) +
                                     "). Remedy: raise the limit of open files (ulimit -n)."}};
  }
  const int on = 1;
  setsockopt(socket.number(), SOL_SOCKET, SO_REUSEPORT, &on, sizeof on);
  // The forced form passes the system's limit where the process may; else the limit holds.
  if (setsockopt(socket.number(), SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBufferSize,
                 sizeof kReceiveBufferSize) != 0) {
    setsockopt(socket.number(), SOL_SOCKET, SO_RCVBUF, &kReceiveBufferSize,
               sizeof kReceiveBufferSize);
  }
  set_traffic_class(socket.number(), priority);
  const auto* raw = reinterpret_cast<const sockaddr*>(&*address);
  if ((!joins && !is_free(*address)) || bind(socket.number(), raw, sizeof *address) != 0) {
    const int error = errno;
    const std::string remedy =
        error == EADDRINUSE ? "Remedy: end the program that has it (ss -lptun), or choose another "
                              "port; 0 lets the system choose."
                            : "Remedy: give an address of this host, such as 127.0.0.1.";
    return unexpected{TransportError{"UDP " + name + " can't be served (" + std::strerror(error) +
                                     "). " + remedy}};
  }
  return UdpPort(std::move(socket));
}

expected<Datagram, IoError> UdpPort::receive(MutableBytes buffer) noexcept {
  sockaddr_in from{};
  socklen_t from_size = sizeof from;
  const ssize_t count = recvfrom(socket_.number(), buffer.data(), buffer.size(), MSG_DONTWAIT,
                                 reinterpret_cast<sockaddr*>(&from), &from_size);
  if (count < 0) {
    const bool is_nothing = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    return unexpected{is_nothing ? IoError::kNothing : IoError::kFailed};
  }
  return Datagram{buffer.first(static_cast<std::size_t>(count)),
                  {0, from.sin_addr.s_addr, from.sin_port}};
}

expected<void, IoError> UdpPort::send(const wire::PeerAddress& peer, ConstBytes frame) noexcept {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = static_cast<in_port_t>(peer.port);
  to.sin_addr.s_addr = static_cast<in_addr_t>(peer.low);
  const ssize_t count =
      sendto(socket_.number(), frame.data(), frame.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
             reinterpret_cast<const sockaddr*>(&to), sizeof to);
  if (count == static_cast<ssize_t>(frame.size())) return {};
  const bool is_full = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS;
  return unexpected{is_full ? IoError::kFull : IoError::kFailed};
}

}  // namespace rtpm::transport
