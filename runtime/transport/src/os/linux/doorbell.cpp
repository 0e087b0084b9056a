#include "os/doorbell.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>

namespace rtpm::transport::os {

std::optional<Doorbell> Doorbell::open() noexcept {
  Descriptor event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!event.is_open()) return std::nullopt;
  return Doorbell(std::move(event), Descriptor());
}

void Doorbell::ring() noexcept {
  const std::uint64_t one = 1;
  const ssize_t size = write(heard_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full counter is already readable.
}

void Doorbell::clear() noexcept {
  std::uint64_t rings = 0;
  const ssize_t size = read(heard_.number(), &rings, sizeof rings);
  static_cast<void>(size);  // Nothing to read: another thread has read it.
}

}  // namespace rtpm::transport::os
