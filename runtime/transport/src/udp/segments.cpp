#include "udp/segments.hpp"

#include <netinet/udp.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "sockets/native.hpp"

// Older C libraries lack them.
#ifndef UDP_SEGMENT
#define UDP_SEGMENT 103
#endif
#ifndef UDP_GRO
#define UDP_GRO 104
#endif

namespace rtpm::transport {
namespace {

// A message of one part. `peer` may be null.
msghdr message_of(iovec& part, sockaddr_in* peer) noexcept {
  msghdr message{};
  message.msg_name = peer;
  message.msg_namelen = peer == nullptr ? 0 : sizeof *peer;
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  return message;
}

}  // namespace

void accept_segments(int socket, bool is_on) noexcept {
  set_option(socket, IPPROTO_UDP, UDP_GRO, is_on ? 1 : 0);
}

ssize_t send_segments(int socket, const sockaddr_in* to, const DatagramBatch& batch) noexcept {
  const auto segment_size = static_cast<std::uint16_t>(batch.frame_size());
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof segment_size)> control{};
  iovec part{.iov_base = const_cast<std::byte*>(batch.bytes().data()),
             .iov_len = batch.bytes().size()};
  msghdr message = message_of(part, const_cast<sockaddr_in*>(to));
  if (batch.bytes().size() > batch.frame_size()) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const entry = CMSG_FIRSTHDR(&message);
    entry->cmsg_level = IPPROTO_UDP;
    entry->cmsg_type = UDP_SEGMENT;
    entry->cmsg_len = CMSG_LEN(sizeof segment_size);
    std::memcpy(CMSG_DATA(entry), &segment_size, sizeof segment_size);
  }
  return sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

bool means_no_batches(int error) noexcept {
  // No checksum offload, an unknown option, a path with a smaller MTU.
  return error == EIO || error == EINVAL || error == EOPNOTSUPP || error == EMSGSIZE;
}

ssize_t receive_datagrams(int socket, bool are_segments, MutableBytes buffer, sockaddr_in* from,
                          int flags, std::size_t& each) noexcept {
  if (!are_segments) {
    socklen_t size = sizeof *from;
    const ssize_t count = recvfrom(socket, buffer.data(), buffer.size(), flags,
                                   reinterpret_cast<sockaddr*>(from), from ? &size : nullptr);
    each = static_cast<std::size_t>(std::max<ssize_t>(count, 0));
    return count;
  }
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(int))> control;
  iovec part{.iov_base = buffer.data(), .iov_len = buffer.size()};
  msghdr message = message_of(part, from);
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t count = recvmsg(socket, &message, flags);
  each = count > 0 ? static_cast<std::size_t>(count) : 0;
  if (count <= 0 || message.msg_controllen < sizeof(cmsghdr)) return count;
  const cmsghdr* const entry = CMSG_FIRSTHDR(&message);
  if (entry->cmsg_level == IPPROTO_UDP && entry->cmsg_type == UDP_GRO) {
    int segment_size = 0;
    std::memcpy(&segment_size, CMSG_DATA(entry), sizeof segment_size);
    if (segment_size > 0) each = static_cast<std::size_t>(segment_size);
  }
  return count;
}

}  // namespace rtpm::transport
