#include "rtpm/transport/lan_socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "os/native_socket.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

SocketAddress address_of_peer(const LanPeer& peer) noexcept {
  return SocketAddress::of_ipv4(peer.ipv4, peer.port);
}

Descriptor make_lan_socket() noexcept {
  return os::open_socket(AF_INET, SOCK_DGRAM, os::Blocking::kNo);
}

unexpected<SetupError> failed(const std::string& what, const std::string& remedy = {}) {
  return unexpected{SetupError{what, error_text(errno), remedy, system_error(errno)}};
}

}  // namespace

expected<std::vector<NetworkInterface>, SetupError> multicast_interfaces(std::string_view wanted) {
  std::vector<NetworkInterface> found;
  std::string others;
  for (const InterfaceAddress& own : own_addresses()) {
    if (!own.has_multicast || !own.address.is_ipv4()) continue;
    NetworkInterface interface { own.interface, own.address.host() };
    others += (others.empty() ? "" : ", ") + interface.name + " (" + interface.address + ")";
    if (wanted == "any" || wanted == interface.name || wanted == interface.address) {
      found.push_back(std::move(interface));
    }
  }
  if (!found.empty()) return found;
  return setup_error(wanted == "any"
                         ? "this host has no interface for multicast"
                         : "this host has no interface '" + std::string(wanted) + "' for multicast",
                     others.empty() ? "" : "it has " + others,
                     "name one that is up and has an IPv4 address (ip -4 address)");
}

std::string address_text(std::uint32_t ipv4) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8)
    text += (text.empty() ? "" : ".") + std::to_string(ipv4 >> shift & 0xffU);
  return text;
}

std::string to_string(const LanPeer& peer) {
  return address_text(peer.ipv4) + ":" + std::to_string(peer.port);
}

std::uint32_t parse_address(const std::string& text) noexcept {
  in_addr address{};
  return inet_pton(AF_INET, text.c_str(), &address) == 1 ? ntohl(address.s_addr) : 0;
}

expected<LanSocket, SetupError> LanSocket::open(const std::string& address, std::uint16_t port) {
  Descriptor socket = make_lan_socket();
  const int number = socket.number();
  in_addr own{};
  if (inet_pton(AF_INET, address.c_str(), &own) != 1) {
    return setup_error("'" + address + "' is no IPv4 address");
  }
  const SocketAddress name = SocketAddress::of_ipv4(ntohl(own.s_addr), port);
  const bool is_set =
      socket.is_open() && (port == 0 || set_option(number, SOL_SOCKET, SO_REUSEADDR, 1)) &&
      os::hear_joined_groups_only(number) && set_option(number, IPPROTO_IP, IP_MULTICAST_TTL, 1) &&
      set_option(number, IPPROTO_IP, IP_MULTICAST_IF, own) && bind_to(number, name) == 0;
  if (!is_set) return failed("UDP " + address + ":" + std::to_string(port) + " can't be used");
  return LanSocket(std::move(socket));
}

expected<LanSocket, SetupError> LanSocket::join(const std::string& group, std::uint16_t port,
                                                const std::vector<NetworkInterface>& interfaces) {
  Descriptor socket = make_lan_socket();
  const int number = socket.number();
  ip_mreq membership{};
  inet_pton(AF_INET, group.c_str(), &membership.imr_multiaddr);
  const SocketAddress name = SocketAddress::of_ipv4(ntohl(membership.imr_multiaddr.s_addr), port);
  const bool is_set = socket.is_open() && set_option(number, SOL_SOCKET, SO_REUSEADDR, 1) &&
                      os::hear_joined_groups_only(number) &&
                      bind_to(number, os::address_to_hear(name)) == 0;
  if (!is_set) return failed("multicast group " + group + " can't be used");
  for (const NetworkInterface& interface : interfaces) {
    inet_pton(AF_INET, interface.address.c_str(), &membership.imr_interface);
    if (!set_option(number, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership)) {
      return failed("multicast group " + group + " can't be joined on " + interface.name);
    }
  }
  return LanSocket(std::move(socket));
}

bool LanSocket::send(ConstBytes datagram, const LanPeer& to) noexcept {
  const SocketAddress name = address_of_peer(to);
  return sendto(socket_.number(), datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                native(name), size_of(name)) == static_cast<std::ptrdiff_t>(datagram.size());
}

ConstBytes LanSocket::receive(MutableBytes buffer, LanPeer& from) noexcept {
  from = {};
  SocketAddress name;
  socklen_t size = SocketAddress::kSizeMax;
  const std::ptrdiff_t count = recvfrom(socket_.number(), buffer.data(), buffer.size(),
                                        MSG_DONTWAIT | MSG_TRUNC, native(name), &size);
  if (count < 0) return {};
  from = {name.ipv4(), name.port()};
  const auto length = static_cast<std::size_t>(count);
  return ConstBytes(buffer).first(length <= buffer.size() ? length : 0);
}

LanPeer LanSocket::name() const noexcept {
  const SocketAddress own = own_address(socket_.number());
  return {own.ipv4(), own.port()};
}

void wait_for_any(const std::vector<LanSocket>& sockets, MonotonicTime until) noexcept {
  std::array<pollfd, 64> polled{};
  const std::size_t count = std::min(sockets.size(), polled.size());
  for (std::size_t i = 0; i < count; ++i)
    polled[i] = os::polled(sockets[i].descriptor());
  static_cast<void>(os::poll_until(std::span(polled).first(count), until));
}

}  // namespace rtpm::transport
