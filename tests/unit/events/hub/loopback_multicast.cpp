#include "loopback_multicast.hpp"

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>

namespace rtpm::events::test {
namespace {

std::atomic<std::uint32_t> lost_of{0};

bool is_lost(const sockaddr* to) {
  static std::atomic<std::uint32_t> count{0};
  const std::uint32_t of = lost_of;
  if (of == 0 || to == nullptr || to->sa_family != AF_INET) return false;
  const std::uint32_t address = ntohl(reinterpret_cast<const sockaddr_in*>(to)->sin_addr.s_addr);
  return IN_MULTICAST(address) && ++count % of == 0;
}

}  // namespace

void lose_every(std::uint32_t count) {
  lost_of = count;
}

}  // namespace rtpm::events::test

// Replaces the system's function in this program.
extern "C" ssize_t sendto(int socket, const void* bytes, std::size_t size, int flags,
                          const sockaddr* to, socklen_t to_size) {
  if (rtpm::events::test::is_lost(to)) return static_cast<ssize_t>(size);
  return ::syscall(SYS_sendto, socket, bytes, size, flags, to, to_size);
}
