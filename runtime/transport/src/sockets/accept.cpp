#include "sockets/accept.hpp"

#include <sys/socket.h>

#include <cerrno>

namespace rtpm::transport {

Descriptor spare_descriptor() noexcept {
  return Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
}

Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept {
  Accepted accepted;
  accepted.socket = Descriptor(accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (accepted.socket.is_open()) {
    if (!spare.is_open()) spare = spare_descriptor();
    return accepted;
  }
  if (!is_shortage(errno)) return accepted;
  accepted.shortage = errno;
  { const Descriptor room = std::move(spare); }
  {
    const Descriptor unwanted(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
    accepted.still_waits = !unwanted.is_open() && is_shortage(errno);
  }
  spare = spare_descriptor();
  return accepted;
}

}  // namespace rtpm::transport
