#include <fcntl.h>
#include <sys/time.h>

#include <array>
#include <chrono>
#include <cstring>

#include "os/native_socket.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {

const char* error_text(int error) noexcept {
  return std::strerror(error);
}

namespace os {

void close(int descriptor) noexcept {
  ::close(descriptor);
}

Descriptor duplicate(int socket) noexcept {
  return Descriptor(fcntl(socket, F_DUPFD_CLOEXEC, 0));
}

bool is_open(int descriptor) noexcept {
  return fcntl(descriptor, F_GETFD) >= 0;
}

void limit_blocking(int socket, Duration time) noexcept {
  timeval limit{};
  limit.tv_usec = static_cast<decltype(limit.tv_usec)>(time / std::chrono::microseconds{1});
  set_option(socket, SOL_SOCKET, SO_RCVTIMEO, limit);
  fcntl(socket, F_SETFL, fcntl(socket, F_GETFL) & ~O_NONBLOCK);
}

void prepare_server_port(int socket) noexcept {
  set_option(socket, SOL_SOCKET, SO_REUSEPORT, 1);
}

void prepare_listener(int socket) noexcept {
  set_option(socket, SOL_SOCKET, SO_REUSEADDR, 1);
}

SocketAddress address_to_hear(const SocketAddress& group) noexcept {
  return group;
}

bool is_own_or_root(std::uint32_t user) noexcept {
  return user == geteuid() || user == 0;
}

std::uint32_t zone_of(const std::string& interface) {
  return if_nametoindex(interface.c_str());
}

std::string name_of_zone(std::uint32_t zone) {
  std::array<char, IF_NAMESIZE> name{};
  return if_indextoname(zone, name.data()) != nullptr ? std::string(name.data())
                                                      : std::to_string(zone);
}

std::string lookup_error_text(int error) {
  return gai_strerror(error);
}

}  // namespace os
}  // namespace rtpm::transport
