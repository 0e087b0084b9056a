#include "shared_memory/unix_socket.hpp"

#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>

#include "rtpm/base/assert.hpp"
#include "rtpm/transport/socket_users.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::transport {
namespace {

std::string name_of(const SharedMemoryAddress& address) {
  return wire::host_and_port(address.host, address.port);
}

}  // namespace

std::string socket_file_of(const SharedMemoryAddress& address) {
  return address.folder.empty() ? "" : address.folder + "/" + name_of(address);
}

std::string in_words(const SharedMemoryAddress& address) {
  return "UNIX socket " +
         (address.folder.empty() ? "@rtpm/" + name_of(address) : socket_file_of(address));
}

unsigned to_native(const SharedMemoryAddress& address, sockaddr_un& native) noexcept {
  native = {};
  native.sun_family = AF_UNIX;
  const bool is_abstract = address.folder.empty();
  const std::string name = is_abstract ? "rtpm/" + name_of(address) : socket_file_of(address);
  // hp-16.1-1: a zero byte precedes an abstract name and follows a file's name.
  if (name.size() + 1 > sizeof native.sun_path) return 0;
  std::memcpy(native.sun_path + (is_abstract ? 1 : 0), name.data(), name.size());
  return static_cast<unsigned>(offsetof(sockaddr_un, sun_path) + name.size() + 1);
}

bool is_trusted(int socket, std::span<const std::uint32_t> others) noexcept {
  const auto user = user_of(socket);
  return user && is_trusted_user(*user, others);
}

bool send_message(int socket, ConstBytes message, std::span<const int> descriptors) noexcept {
  RTPM_ASSERT(descriptors.size() <= kDescriptorCountMax,
              "a message carries at most two descriptors");
  iovec part{const_cast<std::byte*>(message.data()), message.size()};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(kDescriptorCountMax * sizeof(int))> control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (!descriptors.empty()) {
    header.msg_control = control.data();
    header.msg_controllen = CMSG_SPACE(descriptors.size_bytes());
    cmsghdr* const rights = CMSG_FIRSTHDR(&header);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(descriptors.size_bytes());
    std::memcpy(CMSG_DATA(rights), descriptors.data(), descriptors.size_bytes());
  }
  return sendmsg(socket, &header, MSG_DONTWAIT | MSG_NOSIGNAL) ==
         static_cast<ssize_t>(message.size());
}

ReceivedMessage receive_message(int socket, MutableBytes to) noexcept {
  iovec part{to.data(), to.size()};
  // The kernel closes additional descriptors of a hostile peer.
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(kDescriptorCountMax * sizeof(int))> control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  const ssize_t size = recvmsg(socket, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  ReceivedMessage message;
  if (size < 0) return message;
  const cmsghdr* const rights = CMSG_FIRSTHDR(&header);
  if (rights != nullptr && rights->cmsg_level == SOL_SOCKET && rights->cmsg_type == SCM_RIGHTS) {
    const std::size_t count =
        std::min((rights->cmsg_len - CMSG_LEN(0)) / sizeof(int), message.descriptors.size());
    for (std::size_t i = 0; i < count; ++i) {
      int number = -1;
      std::memcpy(&number, CMSG_DATA(rights) + i * sizeof number, sizeof number);
      message.descriptors[i] = Descriptor(number);
    }
  }
  // An RTPM peer never sends more than fit, so a truncation means that no descriptors are left.
  message.lacks_descriptors = (header.msg_flags & MSG_CTRUNC) != 0;
  message.size = static_cast<std::size_t>(size);
  return message;
}

}  // namespace rtpm::transport
