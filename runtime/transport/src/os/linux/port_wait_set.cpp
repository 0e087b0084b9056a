#include "os/linux/port_wait_set.hpp"

#include <utility>

#include "rtpm/rt/budget.hpp"

namespace rtpm::transport {

bool PortWaitSet::add_port(UdpPort& port, MutableBytes buffer, SourceTag tag) noexcept {
  if (!WaitSet::add_port(port, buffer, tag)) return false;
  // It receives only while it has a single source, and this is that source.
  if (port_ != nullptr) return true;
  port_ = &port;
  buffer_ = buffer;
  tag_ = tag;
  return true;
}

void PortWaitSet::remove(int descriptor) noexcept {
  if (port_ != nullptr && port_->descriptor() == descriptor) port_ = nullptr;
  EpollWaitSet::remove(descriptor);
}

std::size_t PortWaitSet::wait(MonotonicTime until, std::span<SourceTag> ready,
                              WaitLock* held) noexcept {
  if (port_ != nullptr && port_->has_received()) return report_received(ready, held);
  if (held == nullptr && may_receive(until)) return wait_by_receiving(ready);
  return EpollWaitSet::wait(until, ready, held);
}

// No poll reports a datagram that an earlier wait received.
std::size_t PortWaitSet::report_received(std::span<SourceTag> ready, WaitLock* held) noexcept {
  ready[0] = tag_;
  if (ready.size() == 1) return 1;
  const std::span<SourceTag> others = ready.subspan(1);
  const std::size_t count = EpollWaitSet::wait(kAlready, others, held);
  for (std::size_t i = 0; i < count; ++i) {
    if (others[i] != tag_) continue;
    others[i] = others[count - 1];
    return count;
  }
  return count + 1;
}

bool PortWaitSet::may_receive(MonotonicTime until) noexcept {
  if (only_polls_ || port_ == nullptr || source_count() > 1 || was_rung()) return false;
  if (!may_block_until(until)) return false;
  if (!std::exchange(is_in_doubt_, false)) return true;
  // The wait since then has polled, and would have reported the datagram if it was merely late.
  only_polls_ = port_->woken_count() == come_count_in_doubt_;
  return !only_polls_;
}

std::size_t PortWaitSet::wait_by_receiving(std::span<SourceTag> ready) noexcept {
  const std::uint64_t sent_count = sent_count_.load(std::memory_order_acquire);
  const std::uint64_t come_count = port_->woken_count();
  // SYNC POINT wait-set-rings: ring() counts first and then checks for the receiver, so either it
  // ends the receive, or its ring is counted by now.
  receiving_.store(port_, std::memory_order_seq_cst);
  bool has_datagram = false;
  bool is_rung = take_rings();
  if (is_rung) {
    doorbell().clear();
  } else {
    const rt::AsleepScope asleep;
    has_datagram = port_->await(buffer_);
  }
  receiving_.store(nullptr, std::memory_order_seq_cst);
  std::size_t count = 0;
  if (has_datagram) {
    ready[count++] = tag_;
  } else if (port_->woken_count() == come_count &&
             sent_count_.load(std::memory_order_acquire) != sent_count) {
    is_in_doubt_ = true;
    come_count_in_doubt_ = come_count;
  }
  if (count == ready.size()) return count;
  if (take_rings()) is_rung = true;
  if (is_rung) ready[count++] = kDoorbell;
  return count;
}

void PortWaitSet::ring() noexcept {
  // SYNC POINT wait-set-rings
  count_ring();
  UdpPort* const port = receiving_.load(std::memory_order_seq_cst);
  if (port == nullptr) return doorbell().ring();
  if (port->wake()) sent_count_.fetch_add(1, std::memory_order_release);
}

}  // namespace rtpm::transport
