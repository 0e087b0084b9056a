#include "rtpm/transport/poller.hpp"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>
#include <optional>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::transport {

expected<Poller, TransportError> Poller::open() {
  Poller poller;
  poller.epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  poller.bell_ = Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!poller.epoll_.is_open() || !poller.bell_.is_open() ||
      !poller.add(poller.bell_.number(), kBell)) {
    return unexpected{TransportError{"a lane can't wait for its sockets (" +
                                     std::string(std::strerror(errno)) +
                                     "). Remedy: raise the limit of open files (ulimit -n)."}};
  }
  return poller;
}

namespace {

bool add_to(const Descriptor& epoll, int descriptor, std::uint64_t tag,
            std::uint32_t events) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag;
  return epoll_ctl(epoll.number(), EPOLL_CTL_ADD, descriptor, &event) == 0;
}

}  // namespace

bool Poller::add(int descriptor, std::uint64_t tag) noexcept {
  return add_to(epoll_, descriptor, tag, EPOLLIN);
}

bool Poller::add_event(int descriptor, std::uint64_t tag) noexcept {
  return add_to(epoll_, descriptor, tag, EPOLLIN | static_cast<std::uint32_t>(EPOLLET));
}

void Poller::remove(int descriptor) noexcept {
  epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, descriptor, nullptr);
}

std::size_t Poller::wait(MonotonicTime until, std::span<std::uint64_t> tags) noexcept {
  constexpr std::size_t kEventCountMax = 64;
  std::array<epoll_event, kEventCountMax> events;
  const int event_count_max = static_cast<int>(std::min(tags.size(), events.size()));
  timespec timeout{};
  if (until != kAlready && until != kNever) {
    const std::int64_t left_ns = std::max<std::int64_t>((until - rt::now()).count(), 0);
    timeout.tv_sec = left_ns / 1'000'000'000;
    timeout.tv_nsec = left_ns % 1'000'000'000;
  }
  std::optional<rt::AsleepScope> asleep;
  if (until != kAlready) asleep.emplace();
  // To the nanosecond, for lanes that wake just ahead of their callers.
  const int count = epoll_pwait2(epoll_.number(), events.data(), event_count_max,
                                 until == kNever ? nullptr : &timeout, nullptr);
  asleep.reset();
  RTPM_ASSERT(count >= 0 || errno == EINTR, "the poller's own descriptor is good");
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    tags[index] = events[index].data.u64;
    if (tags[index] == kBell) {
      std::uint64_t rings = 0;
      const ssize_t size = read(bell_.number(), &rings, sizeof rings);
      static_cast<void>(size);  // Another wait took the rings: there is nothing to do.
    }
  }
  return static_cast<std::size_t>(std::max(count, 0));
}

void Poller::ring() noexcept {
  const std::uint64_t one = 1;
  const ssize_t size = write(bell_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full counter means that the bell rings already.
}

}  // namespace rtpm::transport
