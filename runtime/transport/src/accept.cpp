#include "accept.hpp"

#include <sys/socket.h>

#include <cerrno>

namespace rtpm::transport {

Descriptor spare_descriptor() noexcept {
  return Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
}

Descriptor accept_or_turn_away(int listener, Descriptor& spare) noexcept {
  Descriptor socket(accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!socket.is_open() && (errno == EMFILE || errno == ENFILE)) {
    { const Descriptor room = std::move(spare); }
    { const Descriptor unwanted(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC)); }
    spare = spare_descriptor();
  }
  return socket;
}

}  // namespace rtpm::transport
