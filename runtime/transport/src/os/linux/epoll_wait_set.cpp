#include "os/linux/epoll_wait_set.hpp"

#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::transport {
namespace {

constexpr std::size_t kEventCountMax = 64;

// Nanoseconds matter: a lane wakes just before its callers call.
timespec left_until(MonotonicTime until) noexcept {
  if (until == kAlready || until == kNever) return {};
  return rt::to_timespec(std::max(until - rt::now(), Duration{0}));
}

}  // namespace

expected<void, SetupError> EpollWaitSet::open_epoll() {
  epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  if (!epoll_.is_open() ||
      !register_source({doorbell().descriptor(), Trigger::kLevel, kDoorbell})) {
    return unexpected{no_descriptor("an epoll instance for a thread's sockets", errno)};
  }
  // Checked once, as a wait that fails later could only end the program.
  epoll_event none{};
  const timespec at_once{};
  if (epoll_pwait2(epoll_.number(), &none, 1, &at_once, nullptr) < 0 && errno != EINTR) {
    return setup_error("a lane can't wait for its sockets to the microsecond (epoll_pwait2)",
                       system_error(errno),
                       "use Linux 5.11 or later, and in a container a seccomp profile that knows "
                       "this system call");
  }
  return {};
}

bool EpollWaitSet::add(int descriptor, SourceTag tag, Trigger trigger) noexcept {
  const bool is_few = source_count() < kFewMax && trigger == Trigger::kLevel;
  if (!is_in_epoll_ && is_few) return PollWaitSet::add(descriptor, tag, trigger);
  RTPM_ASSERT(tag.kind() != SourceKind::kDoorbell, "the doorbell is the set's own source");
  if (!has_room_for(descriptor)) return false;
  // In epoll, the system refuses a duplicate.
  if (!is_in_epoll_ && find(descriptor) != sources().end()) return false;
  const bool was_in_epoll = is_in_epoll_;
  sources().push_back({descriptor, trigger, tag});
  if (!(is_in_epoll_ ? register_source(sources().back()) : enter_epoll())) {
    sources().pop_back();
    return false;
  }
  if (trigger == Trigger::kEdge) ++edge_count_;
  // A ppoll in progress does not know the source.
  if (is_blocked() && !was_in_epoll) doorbell().ring();
  return true;
}

void EpollWaitSet::remove(int descriptor) noexcept {
  if (!is_in_epoll_) return PollWaitSet::remove(descriptor);
  const auto source = find(descriptor);
  if (source == sources().end()) return;
  epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, descriptor, nullptr);
  erase(source);
}

void EpollWaitSet::erase(std::vector<Source>::iterator source) noexcept {
  if (source->trigger == Trigger::kEdge) --edge_count_;
  PollWaitSet::erase(source);
}

bool EpollWaitSet::register_source(const Source& source) noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  if (source.trigger == Trigger::kEdge) event.events |= static_cast<std::uint32_t>(EPOLLET);
  event.data.u64 = source.tag.raw();
  return epoll_ctl(epoll_.number(), EPOLL_CTL_ADD, source.descriptor, &event) == 0;
}

// False if the system refuses any source: then all stay out.
bool EpollWaitSet::enter_epoll() noexcept {
  for (const Source& source : sources()) {
    if (register_source(source)) continue;
    leave_epoll();
    return false;
  }
  is_in_epoll_ = true;
  return true;
}

void EpollWaitSet::leave_epoll() noexcept {
  for (const Source& source : sources())
    epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, source.descriptor, nullptr);
  is_in_epoll_ = false;
}

std::size_t EpollWaitSet::wait(MonotonicTime until, std::span<SourceTag> ready,
                               WaitLock* held) noexcept {
  // Leaves epoll only at half the number, so that a source that comes and goes rarely moves the
  // others.
  if (is_in_epoll_ && edge_count_ == 0 && source_count() <= (kFewMax + 1) / 2) leave_epoll();
  return is_in_epoll_ ? wait_for_many(until, ready, held) : PollWaitSet::wait(until, ready, held);
}

std::size_t EpollWaitSet::wait_for_many(MonotonicTime until, std::span<SourceTag> ready,
                                        WaitLock* held) noexcept {
  RTPM_ASSERT(!ready.empty(), "a wait reports at least one source");
  begin_wait();
  std::array<epoll_event, kEventCountMax> events;
  const int event_count_max = static_cast<int>(std::min(ready.size(), events.size()));
  const timespec timeout = left_until(until);
  int event_count = 0;
  {
    const BlockScope scope(*this, until, held);
    event_count = epoll_pwait2(epoll_.number(), events.data(), event_count_max,
                               until == kNever ? nullptr : &timeout, nullptr);
  }
  RTPM_ASSERT(event_count >= 0 || errno == EINTR, "the set's own descriptor is good");
  std::size_t count = 0;
  for (int i = 0; i < event_count; ++i) {
    const SourceTag tag = SourceTag::from_raw(events[static_cast<std::size_t>(i)].data.u64);
    if (tag == kDoorbell && !has_rung()) continue;
    ready[count++] = tag;
  }
  return count;
}

}  // namespace rtpm::transport
