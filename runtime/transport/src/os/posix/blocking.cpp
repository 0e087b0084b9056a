#include <fcntl.h>
#include <sys/time.h>

#include <chrono>

#include "os/native_socket.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport::os {

bool is_open(int descriptor) noexcept {
  return fcntl(descriptor, F_GETFD) >= 0;
}

void limit_blocking(int socket, Duration time) noexcept {
  timeval limit{};
  limit.tv_usec = static_cast<decltype(limit.tv_usec)>(time / std::chrono::microseconds{1});
  set_option(socket, SOL_SOCKET, SO_RCVTIMEO, limit);
  fcntl(socket, F_SETFL, fcntl(socket, F_GETFL) & ~O_NONBLOCK);
}

}  // namespace rtpm::transport::os
