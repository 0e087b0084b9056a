#include "rtpm/transport/multicast.hpp"

#include <cerrno>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/transport/address.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// Holds a burst while the receiver's program is busy.
constexpr int kBurstBufferSize = 4 << 20;

std::string name_of(const MulticastGroup& group) {
  return "multicast group " + group.group + ":" + std::to_string(group.port);
}

unexpected<SetupError> failed(const MulticastGroup& group, const std::string& why,
                              const std::string& remedy = {}) {
  return setup_error(name_of(group) + " can't be used", why, remedy);
}

/// A group's addresses in the form that system calls use.
struct Addresses {
  SocketAddress group{};
  in_addr interface {};
};

expected<Addresses, SetupError> addresses_of(const MulticastGroup& group) {
  Addresses addresses;
  const auto address = SocketAddress::parse(group.group, group.port);
  constexpr std::uint32_t kMulticastNet = 0xe;  // 224.0.0.0/4
  if (!address || !address->is_ipv4() || address->ipv4() >> 28 != kMulticastNet ||
      group.port == 0) {
    return failed(group, "that is no multicast address with a port",
                  "give an address from 224.0.0.0 to 239.255.255.255, best one that begins with "
                  "239, and a port");
  }
  addresses.group = *address;
  addresses.interface.s_addr = htonl(INADDR_ANY);
  if (!group.interface.empty() &&
      inet_pton(AF_INET, group.interface.c_str(), &addresses.interface) != 1) {
    return failed(group, "'" + group.interface + "' is no address of an interface",
                  "give one that `ip -4 address` shows");
  }
  return addresses;
}

Descriptor make_multicast_socket() noexcept {
  return os::open_socket(AF_INET, SOCK_DGRAM, os::Blocking::kNo);
}

}  // namespace

expected<MulticastSender, SetupError> MulticastSender::open(const MulticastGroup& group) {
  const auto addresses = addresses_of(group);
  if (!addresses) return unexpected{addresses.error()};
  Descriptor socket = make_multicast_socket();
  const int number = socket.number();
  const bool is_set = socket.is_open() &&
                      set_option(number, IPPROTO_IP, IP_MULTICAST_TTL, int{group.hops}) &&
                      set_option(number, IPPROTO_IP, IP_MULTICAST_LOOP, 1) &&
                      (group.interface.empty() ||
                       set_option(number, IPPROTO_IP, IP_MULTICAST_IF, addresses->interface));
  if (!is_set) return failed(group, error_text(errno));
  return MulticastSender(std::move(socket), addresses->group.ipv4(), addresses->group.port());
}

bool MulticastSender::send(ConstBytes datagram) noexcept {
  const auto to = SocketAddress::of_ipv4(group_, port_);
  return sendto(socket_.number(), datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                native(to), size_of(to)) == static_cast<std::ptrdiff_t>(datagram.size());
}

expected<MulticastReceiver, SetupError> MulticastReceiver::open(const MulticastGroup& group) {
  const auto addresses = addresses_of(group);
  if (!addresses) return unexpected{addresses.error()};
  Descriptor socket = make_multicast_socket();
  const int number = socket.number();
  ip_mreq membership{};
  membership.imr_multiaddr.s_addr = htonl(addresses->group.ipv4());
  membership.imr_interface = addresses->interface;
  // Not the datagrams of groups that other programs on the host have joined on the same port.
  const bool is_set = socket.is_open() && set_option(number, SOL_SOCKET, SO_REUSEADDR, 1) &&
                      os::hear_joined_groups_only(number) &&
                      bind_to(number, os::address_to_hear(addresses->group)) == 0 &&
                      set_option(number, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership);
  if (!is_set) return failed(group, error_text(errno));
  os::enlarge_receive_buffer(number, kBurstBufferSize);
  return MulticastReceiver(std::move(socket));
}

ConstBytes MulticastReceiver::receive(MutableBytes buffer) noexcept {
  const std::ptrdiff_t count =
      recv(socket_.number(), buffer.data(), buffer.size(), MSG_DONTWAIT | MSG_TRUNC);
  // A datagram that does not fit is not RTPM's, and counts as empty.
  if (count < 0) return {};
  const auto size = static_cast<std::size_t>(count);
  return ConstBytes(buffer).first(size <= buffer.size() ? size : 0);
}

}  // namespace rtpm::transport
