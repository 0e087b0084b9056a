#include "peer_port.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

sockaddr_in local_address(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

bool wait_for(int family, const sockaddr* address, socklen_t size) {
  const MonotonicTime give_up = rt::now() + std::chrono::seconds{10};
  while (rt::now() < give_up) {
    const int handle = socket(family, SOCK_STREAM, 0);
    const bool is_there = connect(handle, address, size) == 0;
    close(handle);
    if (is_there) return true;
    rt::sleep_until(rt::now() + std::chrono::milliseconds{10});
  }
  return false;
}

}  // namespace

std::uint16_t free_port() {
  const int handle = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = local_address(0);
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  const bool is_bound =
      bind(handle, generic, size) == 0 && getsockname(handle, generic, &size) == 0;
  close(handle);
  return is_bound ? ntohs(address.sin_port) : std::uint16_t{0};
}

bool wait_for_port(std::uint16_t port) {
  const sockaddr_in address = local_address(port);
  return wait_for(AF_INET, reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

bool wait_for_socket(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  return wait_for(AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

}  // namespace rtpm::bench
