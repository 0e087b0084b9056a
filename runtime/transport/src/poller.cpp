#include "rtpm/transport/poller.hpp"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "side_watch.hpp"

namespace rtpm::transport {

Poller::Poller() noexcept = default;
Poller::Poller(Poller&&) noexcept = default;
Poller& Poller::operator=(Poller&&) noexcept = default;
Poller::~Poller() = default;

expected<Poller, TransportError> Poller::open() {
  Poller poller;
  poller.epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  poller.bell_ = Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!poller.epoll_.is_open() || !poller.bell_.is_open() ||
      !poller.add(poller.bell_.number(), kBell)) {
    return unexpected{no_descriptor("an epoll instance for a lane's sockets", errno)};
  }
  // Asked once, as a wait that fails later could only end the program.
  epoll_event none{};
  const timespec at_once{};
  if (epoll_pwait2(poller.epoll_.number(), &none, 1, &at_once, nullptr) < 0 && errno != EINTR) {
    return unexpected{
        TransportError{"a lane can't wait for its sockets to the microsecond "
                       "(epoll_pwait2: " +
                       std::string(std::strerror(errno)) +
                       "). Remedy: use Linux 5.11 or later, and in a container a "
                       "seccomp profile that knows this system call."}};
  }
  return poller;
}

void Poller::allow_receives() {
  side_ = SideWatch::open();
}

namespace {

bool add_to(const Descriptor& epoll, int descriptor, std::uint64_t tag,
            std::uint32_t events) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag;
  return epoll_ctl(epoll.number(), EPOLL_CTL_ADD, descriptor, &event) == 0;
}

// How long it is until then: to the nanosecond, for lanes that wake just ahead of their callers.
timespec left_until(MonotonicTime until) noexcept {
  if (until == Poller::kAlready || until == kNever) return {};
  return rt::to_timespec(std::max(until - rt::now(), Duration{0}));
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
  const timespec timeout = left_until(until);
  std::optional<rt::AsleepScope> asleep;
  if (until != kAlready) asleep.emplace();
  const int count = epoll_pwait2(epoll_.number(), events.data(), event_count_max,
                                 until == kNever ? nullptr : &timeout, nullptr);
  asleep.reset();
  RTPM_ASSERT(count >= 0 || errno == EINTR, "the poller's own descriptor is good");
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    tags[index] = events[index].data.u64;
    if (tags[index] == kBell) take_rings();
  }
  return static_cast<std::size_t>(std::max(count, 0));
}

std::size_t Poller::wait_for(std::span<const Watched> few, MonotonicTime until,
                             std::span<std::uint64_t> tags) noexcept {
  RTPM_ASSERT(few.size() <= kFewMax && tags.size() > few.size(),
              "there is room for the few and the bell");
  was_rung_ = false;
  std::array<pollfd, kFewMax + 1> entries;
  entries[0] = {.fd = bell_.number(), .events = POLLIN, .revents = 0};
  for (std::size_t i = 0; i < few.size(); ++i)
    entries[i + 1] = {.fd = few[i].descriptor, .events = POLLIN, .revents = 0};
  const timespec timeout = left_until(until);
  std::optional<rt::AsleepScope> asleep;
  if (until != kAlready) asleep.emplace();
  const int ready_count =
      ppoll(entries.data(), few.size() + 1, until == kNever ? nullptr : &timeout, nullptr);
  asleep.reset();
  RTPM_ASSERT(ready_count >= 0 || errno == EINTR, "there is nothing wrong with the descriptors");
  if (ready_count <= 0) return 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < few.size(); ++i) {
    if (entries[i + 1].revents != 0) tags[count++] = few[i].tag;
  }
  if (entries[0].revents != 0) {
    tags[count++] = kBell;
    take_rings();
  }
  return count;
}

std::size_t Poller::receive_for(UdpPort& port, MutableBytes buffer, std::uint64_t tag,
                                MonotonicTime until, std::span<std::uint64_t> tags) noexcept {
  if (was_rung_ || !may_block_until(until)) {
    const Watched watched{port.descriptor(), tag};
    return wait_for({&watched, 1}, until, tags);
  }
  // SYNC POINT poller-rings: whoever rings counts first and then looks for the receiver, so either
  // it wakes the receive, or it is counted by now.
  rings_->receiver.store(&port, std::memory_order_seq_cst);
  bool has_datagram = false;
  was_rung_ = has_rung();
  if (was_rung_) {
    take_rings();
  } else {
    const rt::AsleepScope asleep;
    has_datagram = port.await(buffer);
  }
  rings_->receiver.store(nullptr, std::memory_order_seq_cst);
  if (has_rung()) was_rung_ = true;
  std::size_t count = 0;
  if (has_datagram) tags[count++] = tag;
  if (was_rung_) tags[count++] = kBell;
  return count;
}

std::size_t Poller::receive_for(Connection& connection, std::uint64_t tag, const Watched& other,
                                MonotonicTime until, std::span<std::uint64_t> tags) noexcept {
  if (!may_block_until(until) || !may_receive_beside(other)) {
    const std::array<Watched, 2> both{other, {connection.descriptor(), tag}};
    const std::size_t count = wait_for(both, until, tags);
    const bool was_alone = count == 1 && tags[0] == tag;
    if (count > 0) alone_count_ = was_alone ? std::min(alone_count_ + 1, kAloneMin) : 0;
    return count;
  }
  const rt::AsleepScope asleep;
  // If it was one of the others that ended it, the next wait sees so before it begins.
  if (!connection.await_news()) return 0;
  tags[0] = tag;
  return 1;
}

// Whether neither the other nor the bell has something to tell, and a receive will end when one
// has.
bool Poller::may_receive_beside(const Watched& other) noexcept {
  if (alone_count_ < kAloneMin || side_ == nullptr || !side_->is_open()) return false;
  const std::array<int, 2> watched{bell_.number(), other.descriptor};
  if (!side_->is_on() && !side_->begin(watched)) return false;
  if (!side_->has_news()) return true;
  end_receives();
  return false;
}

void Poller::end_receives() noexcept {
  alone_count_ = 0;
  if (side_ != nullptr) side_->end();
}

// Whether the bell rang since this was last asked.
bool Poller::has_rung() noexcept {
  const std::uint64_t count = rings_->count.load(std::memory_order_seq_cst);
  return std::exchange(heard_count_, count) != count;
}

void Poller::take_rings() noexcept {
  was_rung_ = true;
  static_cast<void>(has_rung());
  std::uint64_t rings = 0;
  const ssize_t size = read(bell_.number(), &rings, sizeof rings);
  static_cast<void>(size);  // Another wait took the rings: there is nothing to do.
}

void Poller::ring() noexcept {
  // SYNC POINT poller-rings
  rings_->count.fetch_add(1, std::memory_order_seq_cst);
  if (UdpPort* const receiver = rings_->receiver.load(std::memory_order_seq_cst)) {
    receiver->wake();
    return;
  }
  const std::uint64_t one = 1;
  const ssize_t size = write(bell_.number(), &one, sizeof one);
  static_cast<void>(size);  // A full counter means that the bell rings already.
}

}  // namespace rtpm::transport
