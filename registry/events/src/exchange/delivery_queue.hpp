#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "event_store.hpp"
#include "rtpm/events/delivery.hpp"

namespace rtpm::events {

/// Pending events of one consumer. The events of a delivery stay together.
/// @ownership references to its events
class DeliveryQueue {
 public:
  DeliveryQueue() noexcept = default;
  DeliveryQueue(QueuePolicy policy, std::uint32_t capacity);

  /// Appends a delivery; false if the queue is full with QueuePolicy::kDisconnect.
  [[nodiscard]] bool push(std::span<const EventRef> group, Losses& losses) noexcept;
  /// Moves the deliveries of another queue to the end; false under the same condition as push().
  [[nodiscard]] bool take_over(DeliveryQueue& other, Losses& losses) noexcept;

  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The i-th event from the front, and whether the next one belongs to the same delivery.
  struct Entry {
    EventRef event{};
    bool is_continued = false;
  };
  [[nodiscard]] const Entry& operator[](std::size_t i) const noexcept {
    return entries_[(head_ + i) % entries_.size()];
  }
  /// Removes the front event.
  void pop() noexcept;
  /// Removes the whole front delivery; returns its number of events.
  std::size_t drop_front() noexcept;
  /// Removes all events.
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
