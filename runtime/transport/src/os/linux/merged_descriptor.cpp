#include "rtpm/transport/merged_descriptor.hpp"

#include <sys/epoll.h>
#include <sys/timerfd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "os/doorbell.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::transport {
namespace {

constexpr std::uint64_t kAlarmTag = MergedDescriptor::kTagMax + 1;
constexpr std::uint64_t kRingTag = MergedDescriptor::kTagMax + 2;

class EpollDescriptor final : public MergedDescriptor {
 public:
  EpollDescriptor(Descriptor epoll, Descriptor alarm, os::Doorbell doorbell) noexcept
      : epoll_(std::move(epoll)), alarm_(std::move(alarm)), doorbell_(std::move(doorbell)) {}
  [[nodiscard]] bool watch_own() noexcept {
    return control(EPOLL_CTL_ADD, alarm_.number(), EPOLLIN, kAlarmTag) &&
           control(EPOLL_CTL_ADD, doorbell_.descriptor(), EPOLLIN, kRingTag);
  }

  [[nodiscard]] int number() const noexcept override { return epoll_.number(); }
  [[nodiscard]] bool watch(int descriptor, std::uint64_t tag) noexcept override;
  void unwatch(int descriptor) noexcept override;
  void set_alarm(MonotonicTime time) noexcept override;
  void ring() noexcept override { doorbell_.ring(); }
  [[nodiscard]] std::span<std::uint64_t> take(std::span<std::uint64_t> ready) noexcept override;

 private:
  [[nodiscard]] bool control(int operation, int descriptor, std::uint32_t events,
                             std::uint64_t tag) noexcept;

  Descriptor epoll_;
  Descriptor alarm_;
  os::Doorbell doorbell_;
};

bool EpollDescriptor::control(int operation, int descriptor, std::uint32_t events,
                              std::uint64_t tag) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag;
  return epoll_ctl(epoll_.number(), operation, descriptor, &event) == 0;
}

bool EpollDescriptor::watch(int descriptor, std::uint64_t tag) noexcept {
  RTPM_ASSERT(tag <= kTagMax, "the highest tags are the set's own");
  constexpr std::uint32_t kOnce = EPOLLIN | EPOLLONESHOT;
  return control(EPOLL_CTL_ADD, descriptor, kOnce, tag) ||
         (errno == EEXIST && control(EPOLL_CTL_MOD, descriptor, kOnce, tag));
}

void EpollDescriptor::unwatch(int descriptor) noexcept {
  // Fails if the descriptor was closed, which has removed it.
  static_cast<void>(control(EPOLL_CTL_DEL, descriptor, 0, 0));
}

void EpollDescriptor::set_alarm(MonotonicTime time) noexcept {
  itimerspec alarm{};
  // Zero would disarm the timer.
  constexpr MonotonicTime kFirst{Duration{1}};
  if (time != kNever) alarm.it_value = rt::to_timespec(std::max(time, kFirst));
  const int result = timerfd_settime(alarm_.number(), TFD_TIMER_ABSTIME, &alarm, nullptr);
  RTPM_ASSERT(result == 0, "a timer takes any time");
}

std::span<std::uint64_t> EpollDescriptor::take(std::span<std::uint64_t> ready) noexcept {
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
      doorbell_.clear();
    }
  }
  return ready.first(count);
}

}  // namespace

expected<std::unique_ptr<MergedDescriptor>, SetupError> MergedDescriptor::open() {
  Descriptor epoll(epoll_create1(EPOLL_CLOEXEC));
  Descriptor alarm(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  auto doorbell = os::Doorbell::open();
  if (epoll.is_open() && alarm.is_open() && doorbell) {
    auto merged =
        std::make_unique<EpollDescriptor>(std::move(epoll), std::move(alarm), std::move(*doorbell));
    if (merged->watch_own()) return std::unique_ptr<MergedDescriptor>(std::move(merged));
  }
  return unexpected{no_descriptor("a descriptor that reports for others", errno)};
}

}  // namespace rtpm::transport
