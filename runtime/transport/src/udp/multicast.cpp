#include "rtpm/transport/multicast.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace rtpm::transport {
namespace {

// Room for a burst while the receiver's program is busy.
constexpr int kReceiveBufferSize = 4 << 20;

std::string name_of(const MulticastGroup& group) {
  return "multicast group " + group.group + ":" + std::to_string(group.port);
}

unexpected<SetupError> failed(const MulticastGroup& group, const std::string& why,
                              const std::string& remedy = {}) {
  return setup_error(name_of(group) + " can't be used", why, remedy);
}

/// A group's addresses as the system takes them.
struct Addresses {
  sockaddr_in group{};
  in_addr interface {};
};

expected<Addresses, SetupError> addresses_of(const MulticastGroup& group) {
  Addresses addresses;
  addresses.group.sin_family = AF_INET;
  addresses.group.sin_port = htons(group.port);
  if (inet_pton(AF_INET, group.group.c_str(), &addresses.group.sin_addr) != 1 ||
      !IN_MULTICAST(ntohl(addresses.group.sin_addr.s_addr)) || group.port == 0) {
    return failed(group, "it is none",
                  "give an address from 224.0.0.0 to 239.255.255.255, best one that begins with "
                  "239, and a port");
  }
  addresses.interface.s_addr = htonl(INADDR_ANY);
  if (!group.interface.empty() &&
      inet_pton(AF_INET, group.interface.c_str(), &addresses.interface) != 1) {
    return failed(group, "'" + group.interface + "' is no address of an interface",
                  "give one that `ip -4 address` shows");
  }
  return addresses;
}

Descriptor make_socket() noexcept {
  return Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

template <class T>
bool set(const Descriptor& socket, int level, int option, const T& value) noexcept {
  return setsockopt(socket.number(), level, option, &value, sizeof value) == 0;
}

}  // namespace

expected<MulticastSender, SetupError> MulticastSender::open(const MulticastGroup& group) {
  const auto addresses = addresses_of(group);
  if (!addresses) return unexpected{addresses.error()};
  Descriptor socket = make_socket();
  const int hops = group.hops;
  const int loops_back = 1;
  const bool is_set =
      socket.is_open() && set(socket, IPPROTO_IP, IP_MULTICAST_TTL, hops) &&
      set(socket, IPPROTO_IP, IP_MULTICAST_LOOP, loops_back) &&
      (group.interface.empty() || set(socket, IPPROTO_IP, IP_MULTICAST_IF, addresses->interface));
  if (!is_set) return failed(group, std::strerror(errno));
  return MulticastSender(std::move(socket), addresses->group);
}

bool MulticastSender::send(ConstBytes datagram) noexcept {
  return sendto(socket_.number(), datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                reinterpret_cast<const sockaddr*>(&to_),
                sizeof to_) == static_cast<ssize_t>(datagram.size());
}

expected<MulticastReceiver, SetupError> MulticastReceiver::open(const MulticastGroup& group) {
  const auto addresses = addresses_of(group);
  if (!addresses) return unexpected{addresses.error()};
  Descriptor socket = make_socket();
  const int on = 1;
  const int off = 0;
  ip_mreq membership{};
  membership.imr_multiaddr = addresses->group.sin_addr;
  membership.imr_interface = addresses->interface;
  // Of this group alone, not of others that programs of the host have joined on the port.
  const bool is_set = socket.is_open() && set(socket, SOL_SOCKET, SO_REUSEADDR, on) &&
                      set(socket, IPPROTO_IP, IP_MULTICAST_ALL, off) &&
                      bind(socket.number(), reinterpret_cast<const sockaddr*>(&addresses->group),
                           sizeof addresses->group) == 0 &&
                      set(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership);
  if (!is_set) return failed(group, std::strerror(errno));
  // The forced form passes the system's limit where the process may; else the limit holds.
  if (!set(socket, SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBufferSize)) {
    static_cast<void>(set(socket, SOL_SOCKET, SO_RCVBUF, kReceiveBufferSize));
  }
  return MulticastReceiver(std::move(socket));
}

ConstBytes MulticastReceiver::receive(MutableBytes buffer) noexcept {
  const ssize_t count =
      recv(socket_.number(), buffer.data(), buffer.size(), MSG_DONTWAIT | MSG_TRUNC);
  // One that does not fit is none of ours; it is taken for an empty one of no sender.
  if (count < 0) return {};
  const auto size = static_cast<std::size_t>(count);
  return ConstBytes(buffer).first(size <= buffer.size() ? size : 0);
}

}  // namespace rtpm::transport
