#include "rtpm/transport/polled_wait_set.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
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

// Covers the time in which a wait may block: releases the lock, and counts the thread as asleep.
// Keeps errno.
class PolledWaitSet::BlockScope {
 public:
  BlockScope(PolledWaitSet& set, MonotonicTime until, WaitLock* held) noexcept
      : set_(set), held_(until == kAlready ? nullptr : held) {
    if (held_ != nullptr) {
      set_.is_blocked_ = true;
      held_->unlock();
    }
    if (until != kAlready) asleep_.emplace();
  }
  BlockScope(const BlockScope&) = delete;
  BlockScope& operator=(const BlockScope&) = delete;
  ~BlockScope() {
    const int error = errno;
    asleep_.reset();
    if (held_ != nullptr) {
      held_->lock();
      set_.is_blocked_ = false;
    }
    errno = error;
  }

 private:
  PolledWaitSet& set_;
  WaitLock* held_;
  std::optional<rt::AsleepScope> asleep_;
};

PolledWaitSet::PolledWaitSet(std::size_t source_count_max) : source_count_max_(source_count_max) {
  sources_.reserve(source_count_max);
}

expected<std::unique_ptr<PolledWaitSet>, SetupError> PolledWaitSet::open(
    std::size_t source_count_max) {
  std::unique_ptr<PolledWaitSet> set(new PolledWaitSet(source_count_max));
  if (auto opened = set->open_descriptors(); !opened) return unexpected{std::move(opened.error())};
  return set;
}

expected<void, SetupError> PolledWaitSet::open_descriptors() {
  epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  doorbell_ = Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!epoll_.is_open() || !doorbell_.is_open() ||
      !register_source({doorbell_.number(), Trigger::kLevel, kDoorbell})) {
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

bool PolledWaitSet::add(int descriptor, SourceTag tag, Trigger trigger) noexcept {
  RTPM_ASSERT(tag.kind() != SourceKind::kDoorbell, "the doorbell is the set's own source");
  if (sources_.size() == source_count_max_ || fcntl(descriptor, F_GETFD) < 0) return false;
  // With many sources, epoll refuses a duplicate.
  if (!is_in_epoll_ && find(descriptor) != sources_.end()) return false;
  const bool was_in_epoll = is_in_epoll_;
  sources_.push_back({descriptor, trigger, tag});
  const bool is_few = sources_.size() <= kFewMax && trigger == Trigger::kLevel;
  const bool is_heeded =
      is_in_epoll_ ? register_source(sources_.back()) : (is_few || enter_epoll());
  if (!is_heeded) {
    sources_.pop_back();
    return false;
  }
  if (trigger == Trigger::kEdge) ++edge_count_;
  // A ppoll in progress does not know the source.
  if (is_blocked_ && !was_in_epoll) signal_doorbell();
  return true;
}

void PolledWaitSet::remove(int descriptor) noexcept {
  const auto source = find(descriptor);
  if (source == sources_.end()) return;
  if (is_in_epoll_) {
    epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, descriptor, nullptr);
  } else if (is_blocked_) {
    // A ppoll in progress keeps the file open, so the peer would not see it close.
    signal_doorbell();
  }
  erase(source);
}

std::vector<PolledWaitSet::Source>::iterator PolledWaitSet::find(int descriptor) noexcept {
  return std::ranges::find(sources_, descriptor, &Source::descriptor);
}

void PolledWaitSet::erase(std::vector<Source>::iterator source) noexcept {
  if (source->trigger == Trigger::kEdge) --edge_count_;
  *source = sources_.back();
  sources_.pop_back();
}

bool PolledWaitSet::register_source(const Source& source) noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  if (source.trigger == Trigger::kEdge) event.events |= static_cast<std::uint32_t>(EPOLLET);
  event.data.u64 = source.tag.raw();
  return epoll_ctl(epoll_.number(), EPOLL_CTL_ADD, source.descriptor, &event) == 0;
}

// False if the system refuses any source: then all stay out.
bool PolledWaitSet::enter_epoll() noexcept {
  for (const Source& source : sources_) {
    if (register_source(source)) continue;
    leave_epoll();
    return false;
  }
  is_in_epoll_ = true;
  return true;
}

void PolledWaitSet::leave_epoll() noexcept {
  for (const Source& source : sources_)
    epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, source.descriptor, nullptr);
  is_in_epoll_ = false;
}

std::size_t PolledWaitSet::wait(MonotonicTime until, std::span<SourceTag> ready,
                                WaitLock* held) noexcept {
  RTPM_ASSERT(!ready.empty(), "a wait reports at least one source");
  was_rung_ = false;
  // Leaves epoll only at half the number, so that a source that comes and goes rarely moves the
  // others.
  if (is_in_epoll_ && edge_count_ == 0 && sources_.size() <= (kFewMax + 1) / 2) leave_epoll();
  return is_in_epoll_ ? wait_for_many(until, ready, held) : wait_for_few(until, ready, held);
}

std::size_t PolledWaitSet::wait_for_many(MonotonicTime until, std::span<SourceTag> ready,
                                         WaitLock* held) noexcept {
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

std::size_t PolledWaitSet::wait_for_few(MonotonicTime until, std::span<SourceTag> ready,
                                        WaitLock* held) noexcept {
  std::array<pollfd, kFewMax + 1> entries;
  std::array<SourceTag, kFewMax + 1> tags;
  const std::size_t entry_count = sources_.size() + 1;
  entries[0] = {.fd = doorbell_.number(), .events = POLLIN, .revents = 0};
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    entries[i + 1] = {.fd = sources_[i].descriptor, .events = POLLIN, .revents = 0};
    tags[i + 1] = sources_[i].tag;
  }
  const timespec timeout = left_until(until);
  int ready_count = 0;
  {
    const BlockScope scope(*this, until, held);
    ready_count = ppoll(entries.data(), entry_count, until == kNever ? nullptr : &timeout, nullptr);
  }
  RTPM_ASSERT(ready_count >= 0 || errno == EINTR, "there is nothing wrong with the descriptors");
  std::size_t count = 0;
  const std::size_t first = next_few_;
  for (std::size_t i = 0; i < entry_count && ready_count > 0 && count < ready.size(); ++i) {
    const std::size_t index = (first + i) % entry_count;
    if (entries[index].revents == 0) continue;
    --ready_count;
    if (index == 0 ? has_rung() : is_present(entries[index], tags[index])) {
      ready[count++] = tags[index];
      next_few_ = index + 1;
    }
  }
  return count;
}

// Whether no other thread has removed the source meanwhile. A descriptor that was closed without
// remove() is dropped, as in epoll.
bool PolledWaitSet::is_present(const pollfd& entry, SourceTag tag) noexcept {
  const auto source = find(entry.fd);
  if (source == sources_.end() || source->tag != tag) return false;
  if ((entry.revents & POLLNVAL) == 0) return true;
  erase(source);
  return false;
}

// Whether the readable doorbell means a ring that is not reported yet.
bool PolledWaitSet::has_rung() noexcept {
  clear_doorbell();
  return take_rings();
}

bool PolledWaitSet::take_rings() noexcept {
  // SYNC POINT wait-set-rings
  const std::uint64_t count = ring_count_.load(std::memory_order_seq_cst);
  const bool has_some = std::exchange(heard_count_, count) != count;
  if (has_some) was_rung_ = true;
  return has_some;
}

void PolledWaitSet::clear_doorbell() noexcept {
  std::uint64_t rings = 0;
  const ssize_t size = read(doorbell_.number(), &rings, sizeof rings);
  static_cast<void>(size);  // Nothing to read: another wait has read it.
}

void PolledWaitSet::signal_doorbell() noexcept {
  const std::uint64_t one = 1;
  const ssize_t size = write(doorbell_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full counter is already readable.
}

void PolledWaitSet::ring() noexcept {
  count_ring();
  signal_doorbell();
}

}  // namespace rtpm::transport
