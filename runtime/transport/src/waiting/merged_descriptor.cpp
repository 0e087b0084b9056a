#include "rtpm/transport/merged_descriptor.hpp"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::transport {
namespace {

constexpr std::uint64_t kAlarmTag = MergedDescriptor::kTagMax + 1;
constexpr std::uint64_t kRingTag = MergedDescriptor::kTagMax + 2;

}  // namespace

expected<std::unique_ptr<MergedDescriptor>, SetupError> MergedDescriptor::open() {
  std::unique_ptr<MergedDescriptor> merged(new MergedDescriptor);
  merged->epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  merged->alarm_ = Descriptor(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  merged->doorbell_ = Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!merged->epoll_.is_open() || !merged->alarm_.is_open() || !merged->doorbell_.is_open() ||
      !merged->control(EPOLL_CTL_ADD, merged->alarm_.number(), EPOLLIN, kAlarmTag) ||
      !merged->control(EPOLL_CTL_ADD, merged->doorbell_.number(), EPOLLIN, kRingTag)) {
    return unexpected{no_descriptor("a descriptor that reports for others", errno)};
  }
  return merged;
}

bool MergedDescriptor::control(int operation, int descriptor, std::uint32_t events,
                               std::uint64_t tag) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag;
  return epoll_ctl(epoll_.number(), operation, descriptor, &event) == 0;
}

bool MergedDescriptor::watch(int descriptor, std::uint64_t tag) noexcept {
  RTPM_ASSERT(tag <= kTagMax, "the highest tags are the set's own");
  constexpr std::uint32_t kOnce = EPOLLIN | EPOLLONESHOT;
  return control(EPOLL_CTL_ADD, descriptor, kOnce, tag) ||
         (errno == EEXIST && control(EPOLL_CTL_MOD, descriptor, kOnce, tag));
}

void MergedDescriptor::unwatch(int descriptor) noexcept {
  // Fails if the descriptor was closed, which has removed it.
  static_cast<void>(control(EPOLL_CTL_DEL, descriptor, 0, 0));
}

void MergedDescriptor::set_alarm(MonotonicTime time) noexcept {
  itimerspec alarm{};
  // Zero would disarm the timer.
  constexpr MonotonicTime kFirst{Duration{1}};
  if (time != kNever) alarm.it_value = rt::to_timespec(std::max(time, kFirst));
  const int result = timerfd_settime(alarm_.number(), TFD_TIMER_ABSTIME, &alarm, nullptr);
  RTPM_ASSERT(result == 0, "a timer takes any time");
}

void MergedDescriptor::ring() noexcept {
  const std::uint64_t one = 1;
  const ssize_t size = write(doorbell_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full counter is already readable.
}

std::span<std::uint64_t> MergedDescriptor::take(std::span<std::uint64_t> ready) noexcept {
  std::array<epoll_event, 64> events;
  const auto event_count_max = static_cast<int>(std::min(ready.size(), events.size()));
  const int event_count = epoll_wait(epoll_.number(), events.data(), event_count_max, 0);
  RTPM_ASSERT(event_count >= 0 || errno == EINTR, "the set's own descriptor is good");
  std::size_t count = 0;
  for (int i = 0; i < event_count; ++i) {
    const std::uint64_t tag = events[static_cast<std::size_t>(i)].data.u64;
    if (tag <= kTagMax) {
      ready[count++] = tag;
    } else if (tag == kRingTag) {
      std::uint64_t rings = 0;
      const ssize_t size = read(doorbell_.number(), &rings, sizeof rings);
      static_cast<void>(size);
    }
  }
  return ready.first(count);
}

}  // namespace rtpm::transport
