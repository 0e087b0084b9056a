#include "os/doorbell.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <utility>

namespace rtpm::transport::os {

std::optional<Doorbell> Doorbell::open() noexcept {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return std::nullopt;
  for (const int end : ends) {
    fcntl(end, F_SETFD, FD_CLOEXEC);
    fcntl(end, F_SETFL, fcntl(end, F_GETFL) | O_NONBLOCK);
  }
  return Doorbell(Descriptor(ends[0]), Descriptor(ends[1]));
}

void Doorbell::ring() noexcept {
  const char one = 1;
  const ssize_t size = write(rung_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full pipe is already readable.
}

void Doorbell::clear() noexcept {
  std::array<char, 256> rings{};
  while (read(heard_.number(), rings.data(), rings.size()) == static_cast<ssize_t>(rings.size())) {
  }
}

}  // namespace rtpm::transport::os
