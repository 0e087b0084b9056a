#include "udp/segments.hpp"

#include "bsd_sockets.hpp"
// Behind Winsock's header.
#include <mswsock.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// A function that Winsock has behind an identifier; null if it lacks it.
template <class Function>
Function extension(int socket, GUID identifier) noexcept {
  Function function = nullptr;
  DWORD size = 0;
  WSAIoctl(static_cast<SOCKET>(socket), SIO_GET_EXTENSION_FUNCTION_POINTER, &identifier,
           sizeof identifier, &function, sizeof function, &size, nullptr, nullptr);
  return function;
}

LPFN_WSARECVMSG receive_message(int socket) noexcept {
  static const auto function = extension<LPFN_WSARECVMSG>(socket, WSAID_WSARECVMSG);
  return function;
}
LPFN_WSASENDMSG send_message(int socket) noexcept {
  static const auto function = extension<LPFN_WSASENDMSG>(socket, WSAID_WSASENDMSG);
  return function;
}

constexpr std::size_t kControlSize =
    WSA_CMSG_SPACE(sizeof(IN_PKTINFO)) + WSA_CMSG_SPACE(sizeof(IN6_PKTINFO));
struct alignas(WSACMSGHDR) Control {
  std::array<char, kControlSize> bytes{};
};

WSAMSG message_of(WSABUF& part, Control& control, const SocketAddress* peer) noexcept {
  WSAMSG message{};
  if (peer != nullptr) {
    message.name = const_cast<sockaddr*>(native(*peer));
    message.namelen = static_cast<INT>(peer->size());
  }
  message.lpBuffers = &part;
  message.dwBufferCount = 1;
  message.Control = {static_cast<ULONG>(control.bytes.size()), control.bytes.data()};
  return message;
}

template <class T>
void set_control(WSAMSG& message, int level, int type, const T& value) noexcept {
  WSACMSGHDR* const entry = WSA_CMSG_FIRSTHDR(&message);
  entry->cmsg_level = level;
  entry->cmsg_type = type;
  entry->cmsg_len = WSA_CMSG_LEN(sizeof value);
  std::memcpy(WSA_CMSG_DATA(entry), &value, sizeof value);
  message.Control.len = WSA_CMSG_SPACE(sizeof value);
}

// hp-10-3: the address at which the request arrived.
void set_source(WSAMSG& message, const SocketAddress& from, int family) noexcept {
  if (family == AF_INET) {
    IN_PKTINFO information{};
    information.ipi_addr.s_addr = htonl(from.ipv4());
    return set_control(message, IPPROTO_IP, IP_PKTINFO, information);
  }
  // An IPv6 socket takes an IPv4 address in mapped form.
  const SocketAddress mapped = from.mapped_into_ipv6();
  IN6_PKTINFO information{};
  std::ranges::copy(mapped.ipv6(), information.ipi6_addr.s6_addr);
  information.ipi6_ifindex = mapped.zone();
  set_control(message, IPPROTO_IPV6, IPV6_PKTINFO, information);
}

template <class T>
T value_of(WSACMSGHDR* entry) noexcept {
  T value{};
  std::memcpy(&value, WSA_CMSG_DATA(entry), sizeof value);
  return value;
}

SocketAddress destination_of(const IN6_PKTINFO& information) noexcept {
  SocketAddress::Ipv6 bytes{};
  std::copy_n(information.ipi6_addr.s6_addr, bytes.size(), bytes.begin());
  const auto address = SocketAddress::of_ipv6(bytes, 0, 0);
  if (IN6_IS_ADDR_V4MAPPED(&information.ipi6_addr)) return SocketAddress::of(address.peer());
  // Other addresses are the same on every interface.
  if (!address.is_link_local()) return address;
  return SocketAddress::of_ipv6(bytes, information.ipi6_ifindex, 0);
}

SocketAddress destination_in(WSAMSG& message) noexcept {
  for (WSACMSGHDR* entry = WSA_CMSG_FIRSTHDR(&message); entry != nullptr;
       entry = WSA_CMSG_NXTHDR(&message, entry)) {
    if (entry->cmsg_level == IPPROTO_IPV6 && entry->cmsg_type == IPV6_PKTINFO)
      return destination_of(value_of<IN6_PKTINFO>(entry));
    if (entry->cmsg_level == IPPROTO_IP && entry->cmsg_type == IP_PKTINFO)
      return SocketAddress::of_ipv4(ntohl(value_of<IN_PKTINFO>(entry).ipi_addr.s_addr), 0);
  }
  return {};
}

}  // namespace

// Newer Windows has batches by UDP_SEND_MSG_SIZE; datagrams go singly so far.
void accept_segments(int, bool) noexcept {}

std::ptrdiff_t send_segments(int, const SocketAddress*, const SocketAddress*,
                             const DatagramBatch&) noexcept {
  errno = EOPNOTSUPP;
  return -1;
}

bool means_no_batches(int error) noexcept {
  return error == EOPNOTSUPP;
}

bool receive_destinations(int socket, const SocketAddress& own) noexcept {
  const bool has_messages = receive_message(socket) != nullptr && send_message(socket) != nullptr;
  const bool has_ipv4 = set_option(socket, IPPROTO_IP, IP_PKTINFO, 1);
  return has_messages &&
         (own.is_ipv4() ? has_ipv4 : set_option(socket, IPPROTO_IPV6, IPV6_PKTINFO, 1));
}

std::ptrdiff_t send_from(int socket, const SocketAddress& to, const SocketAddress& from,
                         ConstBytes datagram) noexcept {
  WSABUF part{static_cast<ULONG>(datagram.size()),
              const_cast<char*>(reinterpret_cast<const char*>(datagram.data()))};
  Control control;
  WSAMSG message = message_of(part, control, &to);
  set_source(message, from, to.family());
  DWORD size = 0;
  if (send_message(socket)(static_cast<SOCKET>(socket), &message, 0, &size, nullptr, nullptr) != 0)
    return os::fail();
  return static_cast<std::ptrdiff_t>(size);
}

std::ptrdiff_t receive_datagrams(int socket, bool, MutableBytes buffer, SocketAddress* from,
                                 SocketAddress* to, int flags, std::size_t& each) noexcept {
  if (to == nullptr) {
    socklen_t size = SocketAddress::kSizeMax;
    const std::ptrdiff_t count = recvfrom(socket, buffer.data(), buffer.size(), flags,
                                          from ? native(*from) : nullptr, from ? &size : nullptr);
    each = static_cast<std::size_t>(std::max<std::ptrdiff_t>(count, 0));
    return count;
  }
  WSABUF part{static_cast<ULONG>(buffer.size()), reinterpret_cast<char*>(buffer.data())};
  Control control;
  WSAMSG message = message_of(part, control, nullptr);
  if (from != nullptr) {
    message.name = native(*from);
    message.namelen = static_cast<INT>(SocketAddress::kSizeMax);
  }
  DWORD size = 0;
  const int outcome =
      receive_message(socket)(static_cast<SOCKET>(socket), &message, &size, nullptr, nullptr);
  // The beginning of a datagram that is too long is there.
  if (outcome != 0 && WSAGetLastError() != WSAEMSGSIZE) return os::fail();
  if (outcome != 0) size = static_cast<DWORD>(buffer.size());
  each = size;
  *to = destination_in(message);
  return static_cast<std::ptrdiff_t>(size);
}

}  // namespace rtpm::transport
