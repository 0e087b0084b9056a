#include "os/doorbell.hpp"

#include <array>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/transport/address.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport::os {

// A UDP socket that is connected to itself: polls, and the event loops of others, take sockets only.
std::optional<Doorbell> Doorbell::open() noexcept {
  Descriptor socket = open_socket(AF_INET, SOCK_DGRAM, Blocking::kNo);
  const int number = socket.number();
  if (!socket.is_open()) return std::nullopt;
  prepare_server_port(number);
  const bool is_set = bind_to(number, SocketAddress::of_ipv4(INADDR_LOOPBACK, 0)) == 0 &&
                      connect_to(number, own_address(number)) == 0;
  if (!is_set) return std::nullopt;
  return Doorbell(std::move(socket), Descriptor());
}

void Doorbell::ring() noexcept {
  const std::byte one{1};
  // A full socket is already readable.
  static_cast<void>(::send(heard_.number(), &one, sizeof one, MSG_DONTWAIT));
}

void Doorbell::clear() noexcept {
  std::array<std::byte, 1> ring{};
  while (::recv(heard_.number(), ring.data(), ring.size(), MSG_DONTWAIT) >= 0) {
  }
}

}  // namespace rtpm::transport::os
