#include "isolation.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::driver_host {
namespace {

constexpr std::uint32_t kFrameSizeMax = 4U << 20;

/// Waits for one of `events` on `socket`; false if none occurred by `deadline`.
bool wait_for(const Handle& socket, short events, MonotonicTime deadline) {
  for (;;) {
    const Duration left = std::max(Duration{0}, deadline - rt::now());
    const timespec timeout = rt::to_timespec(left);
    pollfd waited{socket.number(), events, 0};
    const int count = ::ppoll(&waited, 1, deadline == kNever ? nullptr : &timeout, nullptr);
    if (count > 0) return true;
    if (count == 0 || errno != EINTR) return false;
  }
}

bool send_all(const Handle& socket, ConstBytes bytes, MonotonicTime deadline) {
  while (!bytes.empty()) {
    const ssize_t sent =
        ::send(socket.number(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent >= 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(sent));
    } else if (errno != EINTR && (errno != EAGAIN || !wait_for(socket, POLLOUT, deadline))) {
      return false;
    }
  }
  return true;
}

bool receive_all(const Handle& socket, MutableBytes bytes, MonotonicTime deadline) {
  while (!bytes.empty()) {
    const ssize_t received = ::recv(socket.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (received > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(received));
    } else if (received == 0 ||
               (errno != EINTR && (errno != EAGAIN || !wait_for(socket, POLLIN, deadline)))) {
      return false;
    }
  }
  return true;
}

}  // namespace

void Handle::reset() noexcept {
  if (number_ >= 0) ::close(std::exchange(number_, -1));
}

bool SharedDoorbell::wait_until(MonotonicTime deadline) noexcept {
  if (deadline == kNever) {
    while (sem_wait(&semaphore_) != 0) {
      if (errno != EINTR) return false;
    }
    return true;
  }
  const timespec until = rt::to_timespec(deadline);
  int result = 0;
  do {
    result = sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

bool send_frame(const Handle& socket, FrameKind kind, ConstBytes bytes, MonotonicTime deadline) {
  std::array<std::byte, 5> head{};
  store_le(head.data(), static_cast<std::uint32_t>(bytes.size()));
  head[4] = static_cast<std::byte>(kind);
  return bytes.size() <= kFrameSizeMax && send_all(socket, head, deadline) &&
         send_all(socket, bytes, deadline);
}

std::optional<Frame> receive_frame(const Handle& socket, MonotonicTime deadline) {
  std::array<std::byte, 5> head{};
  if (!receive_all(socket, head, deadline)) return std::nullopt;
  const auto size = load_le<std::uint32_t>(head.data());
  if (size > kFrameSizeMax ||
      std::to_integer<std::uint8_t>(head[4]) > static_cast<std::uint8_t>(FrameKind::kFailed)) {
    return std::nullopt;
  }
  Frame frame{.kind = static_cast<FrameKind>(head[4]), .bytes = std::vector<std::byte>(size)};
  if (!receive_all(socket, frame.bytes, deadline)) return std::nullopt;
  return frame;
}

}  // namespace rtpm::driver_host
