#include "udp/distributor.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/rt/clock.hpp"
#include "udp/segments.hpp"

namespace rtpm::transport {

bool LaneInbox::put(const SocketAddress& from, const SocketAddress& to,
                    ConstBytes datagram) noexcept {
  LaneDatagram kept{.from = from, .to = to};
  kept.size = std::min(datagram.size(), kept.bytes.size());
  if (kept.size > 0) std::memcpy(kept.bytes.data(), datagram.data(), kept.size);
  if (!datagrams_.push(kept)) return false;
  ring_unless_rung();
  return true;
}

// SYNC POINT inbox-bell: is_rung_ changes by exchanges only, so either a put after take()'s sees
// false and rings, or take() sees that put's datagram.
void LaneInbox::ring_unless_rung() noexcept {
  if (!is_rung_.exchange(true, std::memory_order_acq_rel)) doorbell_.ring();
}

std::ptrdiff_t LaneInbox::take(MutableBytes buffer, SocketAddress& from, SocketAddress& to,
                               bool waits, std::size_t& size) noexcept {
  auto datagram = datagrams_.pop();
  if (!datagram) {
    if (waits) static_cast<void>(wait_readable(descriptor(), rt::now() + kBlockTime));
    doorbell_.clear();
    // SYNC POINT inbox-bell
    is_rung_.exchange(false, std::memory_order_acq_rel);
    datagram = datagrams_.pop();
    // There may be more, whose bell is cleared.
    if (datagram) ring_unless_rung();
  }
  if (!datagram) {
    errno = EAGAIN;
    return -1;
  }
  from = datagram->from;
  to = datagram->to;
  size = std::min(datagram->size, buffer.size());
  if (size > 0) std::memcpy(buffer.data(), datagram->bytes.data(), size);
  return static_cast<std::ptrdiff_t>(size);
}

expected<std::shared_ptr<Distributor>, SetupError> Distributor::start(
    Descriptor socket, std::vector<std::unique_ptr<LaneInbox>> inboxes, Priority priority,
    rt::RealtimeMode realtime) {
  auto end = os::Doorbell::open();
  if (!end) return unexpected{no_descriptor("a doorbell for the thread of a UDP port", errno)};
  std::shared_ptr<Distributor> started(
      new Distributor(std::move(socket), std::move(inboxes), std::move(*end)));
  auto thread =
      rt::Thread::start({.name = "rtpm-steer", .priority = priority, .realtime = realtime},
                        [distributor = started.get()] { distributor->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  started->thread_ = std::move(*thread);
  return started;
}

Distributor::~Distributor() {
  end_.ring();
}

std::size_t Distributor::lane_of(ConstBytes datagram) const noexcept {
  if (datagram.size() < kPriorityOffset + sizeof(std::uint16_t)) return 0;
  const auto priority = load_le<std::uint16_t>(datagram.data() + kPriorityOffset);
  if (priority > Priority::kHighest) return 0;
  std::size_t lane = 0;
  while (lane + 1 < inboxes_.size() && inboxes_[lane + 1]->low().value() <= priority)
    ++lane;
  return lane;
}

void Distributor::run() noexcept {
  std::array<std::byte, wire::kDatagramFrameSizeMax + 1> buffer{};
  std::array<pollfd, 2> polled{};
  while (true) {
    polled[0] = os::polled(end_.descriptor());
    polled[1] = os::polled(socket_.number());
    static_cast<void>(os::poll_until(polled, kNever));
    if (polled[0].revents != 0) return;
    while (true) {
      SocketAddress from;
      SocketAddress to;
      std::size_t each = 0;
      const std::ptrdiff_t count = receive_datagrams(socket_.number(), /*are_segments=*/false,
                                                     buffer, &from, &to, MSG_DONTWAIT, each);
      if (count < 0) break;
      const ConstBytes datagram = ConstBytes(buffer).first(static_cast<std::size_t>(count));
      inboxes_[lane_of(datagram)]->put(from, to, datagram);
    }
  }
}

}  // namespace rtpm::transport
