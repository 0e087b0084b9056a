#include "udp/segments.hpp"

#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "batch_options.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// Control messages, written one after another, or received.
class Control {
 public:
  template <class T>
  void add(int level, int type, const T& value) noexcept {
    auto* const entry = reinterpret_cast<cmsghdr*>(bytes_.data() + size_);
    entry->cmsg_level = level;
    entry->cmsg_type = type;
    entry->cmsg_len = CMSG_LEN(sizeof value);
    std::memcpy(CMSG_DATA(entry), &value, sizeof value);
    size_ += CMSG_SPACE(sizeof value);
  }
  // hp-10-3: the address at which the request arrived.
  void add_source(const SocketAddress& from, int family) noexcept {
    if (family == AF_INET) {
      in_pktinfo information{};
      information.ipi_spec_dst.s_addr = htonl(from.ipv4());
      return add(IPPROTO_IP, IP_PKTINFO, information);
    }
    // An IPv6 socket takes an IPv4 address in mapped form.
    const SocketAddress mapped = from.mapped_into_ipv6();
    in6_pktinfo information{};
    std::ranges::copy(mapped.ipv6(), information.ipi6_addr.s6_addr);
    information.ipi6_ifindex = mapped.zone();
    add(IPPROTO_IPV6, IPV6_PKTINFO, information);
  }
  void put_into(msghdr& message) noexcept {
    if (size_ == 0) return;
    message.msg_control = bytes_.data();
    message.msg_controllen = size_;
  }
  void receive_into(msghdr& message) noexcept {
    message.msg_control = bytes_.data();
    message.msg_controllen = bytes_.size();
  }

 private:
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(int)) + CMSG_SPACE(sizeof(in6_pktinfo)) +
                                             CMSG_SPACE(sizeof(in_pktinfo))> bytes_;
  std::size_t size_ = 0;
};

// A message with a single buffer. `peer` may be null.
msghdr message_of(iovec& part, const SocketAddress* peer) noexcept {
  msghdr message{};
  message.msg_name = peer == nullptr ? nullptr : const_cast<sockaddr*>(native(*peer));
  message.msg_namelen = peer == nullptr ? 0 : size_of(*peer);
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  return message;
}

template <class T>
T value_of(const cmsghdr& entry) noexcept {
  T value{};
  std::memcpy(&value, CMSG_DATA(&entry), sizeof value);
  return value;
}

SocketAddress destination_of(const in6_pktinfo& information) noexcept {
  SocketAddress::Ipv6 bytes{};
  std::ranges::copy(information.ipi6_addr.s6_addr, bytes.begin());
  const auto address = SocketAddress::of_ipv6(bytes, 0, 0);
  if (IN6_IS_ADDR_V4MAPPED(&information.ipi6_addr)) return SocketAddress::of(address.peer());
  // Other addresses are the same on every interface.
  if (!address.is_link_local()) return address;
  return SocketAddress::of_ipv6(bytes, information.ipi6_ifindex, 0);
}

}  // namespace

void accept_segments(int socket, bool is_on) noexcept {
  if constexpr (os::kHasBatches) {
    set_option(socket, IPPROTO_UDP, os::kBatchOption, is_on ? 1 : 0);
  }
}

bool receive_destinations(int socket, const SocketAddress& own) noexcept {
  return own.is_ipv4() ? set_option(socket, IPPROTO_IP, IP_PKTINFO, 1)
                       : set_option(socket, IPPROTO_IPV6, IPV6_RECVPKTINFO, 1);
}

std::ptrdiff_t send_segments(int socket, const SocketAddress* to, const SocketAddress* from,
                             const DatagramBatch& batch) noexcept {
  iovec part{.iov_base = const_cast<std::byte*>(batch.bytes().data()),
             .iov_len = batch.bytes().size()};
  msghdr message = message_of(part, to);
  Control control;
  if (batch.bytes().size() > batch.frame_size()) {
    if constexpr (!os::kHasBatches) {
      errno = EOPNOTSUPP;
      return -1;
    }
    control.add(IPPROTO_UDP, os::kSegmentOption, static_cast<std::uint16_t>(batch.frame_size()));
  }
  if (from != nullptr) control.add_source(*from, to->family());
  control.put_into(message);
  return sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

std::ptrdiff_t send_from(int socket, const SocketAddress& to, const SocketAddress& from,
                         ConstBytes datagram) noexcept {
  iovec part{.iov_base = const_cast<std::byte*>(datagram.data()), .iov_len = datagram.size()};
  msghdr message = message_of(part, &to);
  Control control;
  control.add_source(from, to.family());
  control.put_into(message);
  return sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

bool means_no_batches(int error) noexcept {
  // No checksum offload, an unknown option, or a path with a smaller MTU.
  return error == EIO || error == EINVAL || error == EOPNOTSUPP || error == EMSGSIZE;
}

std::ptrdiff_t receive_datagrams(int socket, bool are_segments, MutableBytes buffer,
                                 SocketAddress* from, SocketAddress* to, int flags,
                                 std::size_t& each) noexcept {
  if (!are_segments && to == nullptr) {
    socklen_t size = SocketAddress::kSizeMax;
    const std::ptrdiff_t count = recvfrom(socket, buffer.data(), buffer.size(), flags,
                                          from ? native(*from) : nullptr, from ? &size : nullptr);
    each = static_cast<std::size_t>(std::max<std::ptrdiff_t>(count, 0));
    return count;
  }
  iovec part{.iov_base = buffer.data(), .iov_len = buffer.size()};
  msghdr message = message_of(part, from);
  if (from != nullptr) message.msg_namelen = SocketAddress::kSizeMax;
  Control control;
  control.receive_into(message);
  const std::ptrdiff_t count = recvmsg(socket, &message, flags);
  each = count > 0 ? static_cast<std::size_t>(count) : 0;
  if (count < 0) return count;
  for (const cmsghdr* entry = CMSG_FIRSTHDR(&message); entry != nullptr;
       entry = CMSG_NXTHDR(&message, const_cast<cmsghdr*>(entry))) {
    const int type = entry->cmsg_type;
    if (entry->cmsg_level == IPPROTO_UDP && type == os::kBatchOption) {
      const int segment_size = value_of<int>(*entry);
      if (segment_size > 0 && count > 0) each = static_cast<std::size_t>(segment_size);
    } else if (to != nullptr && entry->cmsg_level == IPPROTO_IPV6 && type == IPV6_PKTINFO) {
      *to = destination_of(value_of<in6_pktinfo>(*entry));
    } else if (to != nullptr && entry->cmsg_level == IPPROTO_IP && type == IP_PKTINFO) {
      *to = SocketAddress::of_ipv4(ntohl(value_of<in_pktinfo>(*entry).ipi_spec_dst.s_addr), 0);
    }
  }
  return count;
}

}  // namespace rtpm::transport
