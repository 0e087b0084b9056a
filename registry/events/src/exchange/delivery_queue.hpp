#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "event_store.hpp"
#include "rtpm/events/delivery.hpp"

namespace rtpm::events {

/// The events that wait for one consumer; those that belong together stay together.
/// @ownership references to its events
/// @threads  one at a time
/// @realtime alloc-free but for construction
class DeliveryQueue {
 public:
  DeliveryQueue() noexcept = default;
  DeliveryQueue(QueuePolicy policy, std::uint32_t capacity);

  /// Appends a delivery. False if it is full and its policy is to disconnect.
  [[nodiscard]] bool push(std::span<const EventRef> group, Losses& losses) noexcept;
  /// Appends what another queue holds.
  [[nodiscard]] bool take_over(DeliveryQueue& other, Losses& losses) noexcept;

  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The i-th event from the front, and whether the one behind it belongs to it.
  struct Entry {
    EventRef event{};
    bool is_continued = false;
  };
  [[nodiscard]] const Entry& operator[](std::size_t i) const noexcept {
    return entries_[(head_ + i) % entries_.size()];
  }
  /// Takes one event from the front.
  void pop() noexcept;
  /// Drops the front delivery whole; how many events it had.
  std::size_t drop_front() noexcept;
  /// Drops all.
  void release_events() noexcept {
    while (!empty())
      pop();
  }

 private:
  [[nodiscard]] bool replace(const EventRef& event) noexcept;

  QueuePolicy policy_ = QueuePolicy::kDropOldest;
  std::size_t capacity_ = 0;
  std::vector<Entry> entries_{};
  std::size_t head_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rtpm::events
