#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "broadcast/multicast.hpp"
#include "broadcast/reader_source.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/broadcast_memory.hpp"
#include "rtpm/transport/multicast.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::events {

/// Receives a hub's multicast once for several consumers: one socket, and a history of datagrams
/// for slow consumers.
/// @ownership a socket, two more descriptors, 1.4 MiB
/// @threads  any
class MulticastFeed final : public ReaderSource {
 public:
  /// The number of datagrams kept. Slower consumers request repair from the hub.
  static constexpr std::uint64_t kHistoryCount = 1024;

  /// Joins the group; null if the system refuses.
  [[nodiscard]] static std::shared_ptr<MulticastFeed> open(const transport::MulticastGroup& group);

  /// The position of the next datagram.
  [[nodiscard]] std::uint64_t end() const noexcept { return end_.load(std::memory_order_acquire); }
  /// Calls take(ConstBytes) for up to `count_max` kept datagrams from `position` on. Returns the
  /// next position.
  template <class Take>
  [[nodiscard]] std::uint64_t read(std::uint64_t position, std::uint64_t count_max,
                                   Take take) noexcept {
    if (position == end()) return position;
    const std::lock_guard lock(mutex_);
    position = std::max(position, end() - std::min(end(), kHistoryCount));
    const std::uint64_t last = std::min(end(), position + count_max);
    for (; position != last; ++position) {
      const Slot& slot = slots_[position % kHistoryCount];
      take(ConstBytes(slot.bytes).first(slot.size));
    }
    return position;
  }

  [[nodiscard]] std::uint32_t value() const noexcept override { return bell_.value(); }
  void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept override {
    bell_.sleep(seen, bits, until);
  }
  void ring(std::uint32_t bits) noexcept override { bell_.ring(bits); }
  [[nodiscard]] bool must_be_fetched() const noexcept override { return true; }
  void fetch(std::uint32_t seen, std::uint32_t bits) noexcept override;
  void interrupt_fetch() noexcept override { wait_set_->ring(); }
  void stop() noexcept override;

 private:
  struct Slot {
    std::size_t size = 0;
    std::array<std::byte, kMulticastDatagramMax> bytes{};
  };
  MulticastFeed(transport::MulticastReceiver receiver, std::unique_ptr<transport::WaitSet> wait_set,
                transport::BroadcastBell bell)
      : receiver_(std::move(receiver)),
        wait_set_(std::move(wait_set)),
        bell_(std::move(bell)),
        slots_(kHistoryCount) {}
  [[nodiscard]] bool take_in() noexcept;

  transport::MulticastReceiver receiver_;
  rt::PiMutex fetching_;  ///< Held by the fetching thread, even while it waits.
  std::unique_ptr<transport::WaitSet> wait_set_;
  transport::BroadcastBell bell_;
  std::atomic<bool> is_stopped_{false};
  rt::PiMutex mutex_;  ///< Guards the slots.
  std::vector<Slot> slots_;
  std::atomic<std::uint64_t> end_{0};
};

}  // namespace rtpm::events
