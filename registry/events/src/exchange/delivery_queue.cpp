#include "exchange/delivery_queue.hpp"

#include <array>

#include "filter/compiled_filter.hpp"

namespace rtpm::events {

// push() appends before it drops, so one more delivery than the capacity must fit.
DeliveryQueue::DeliveryQueue(QueuePolicy policy, std::uint32_t capacity)
    : policy_(policy), capacity_(capacity), entries_(std::size_t{capacity} + kGroupSizeMax) {}

bool DeliveryQueue::replace(const EventRef& event) noexcept {
  for (std::size_t i = size_; i-- > 0;) {
    Entry& entry = entries_[(head_ + i) % entries_.size()];
    const bool is_alone = !entry.is_continued && (i == 0 || !(*this)[i - 1].is_continued);
    if (!is_alone || entry.event.header().type != event.header().type ||
        entry.event.header().source != event.header().source) {
      continue;
    }
    entry.event = event;
    return true;
  }
  return false;
}

bool DeliveryQueue::push(std::span<const EventRef> group, Losses& losses) noexcept {
  if (policy_ == QueuePolicy::kKeepLatest && group.size() == 1 && replace(group[0])) {
    ++losses.replaced_count;
    return true;
  }
  if (policy_ == QueuePolicy::kDisconnect && size_ > 0 && size_ + group.size() > capacity_) {
    return false;
  }
  for (std::size_t i = 0; i < group.size(); ++i) {
    Entry& entry = entries_[(head_ + size_) % entries_.size()];
    entry.event = group[i];
    entry.is_continued = i + 1 < group.size();
    ++size_;
  }
  // A delivery larger than the queue is kept alone.
  while (size_ > capacity_ && size_ > group.size())
    losses.overflow_count += drop_front();
  return true;
}

bool DeliveryQueue::take_over(DeliveryQueue& other, Losses& losses) noexcept {
  while (!other.empty()) {
    std::array<EventRef, kGroupSizeMax> group;
    std::size_t count = 0;
    bool is_continued = true;
    while (is_continued && count < group.size()) {
      group[count++] = other[0].event;
      is_continued = other[0].is_continued;
      other.pop();
    }
    if (!push(std::span(group).first(count), losses)) return false;
  }
  return true;
}

void DeliveryQueue::pop() noexcept {
  entries_[head_].event = EventRef();
  head_ = (head_ + 1) % entries_.size();
  --size_;
}

std::size_t DeliveryQueue::drop_front() noexcept {
  std::size_t count = 0;
  bool is_continued = true;
  while (is_continued && size_ > 0) {
    is_continued = (*this)[0].is_continued;
    pop();
    ++count;
  }
  return count;
}

}  // namespace rtpm::events
