#include "consumer/local_queue.hpp"

#include <algorithm>
#include <array>

namespace rtpm::events {
namespace {

StoreConfig store_for(std::uint32_t capacity) {
  const std::uint32_t count = capacity + kGroupSizeMax;
  return {{{256, count}, {4096, std::min(count, 128U)}, {65'536, 16}, {1'048'576, 2}}};
}

bool is_whole(std::span<const EventRef> group) {
  return std::ranges::all_of(group, [](const EventRef& each) { return static_cast<bool>(each); });
}

}  // namespace

LocalQueue::LocalQueue() {
  group_.reserve(kGroupSizeMax);
  held_.reserve(kGroupSizeMax);
}

void LocalQueue::set_policy(const DeliveryPolicy& policy) {
  auto store = std::make_unique<EventStore>(store_for(policy.queue_capacity));
  DeliveryQueue queue(policy.when_full, policy.queue_capacity);
  while (!queue_.empty()) {
    std::array<EventRef, kGroupSizeMax> group;
    std::size_t count = 0;
    for (bool is_continued = true; is_continued && count < group.size(); queue_.pop()) {
      is_continued = queue_[0].is_continued;
      group[count++] = store->put(queue_[0].event.view());
    }
    const auto taken = std::span(group).first(count);
    // With kDisconnect, the next event ends the subscription.
    if (!is_whole(taken) || !queue.push(taken, losses_)) losses_.overflow_count += count;
  }
  queue_ = std::move(queue);
  store_ = std::move(store);
}

bool LocalQueue::push(std::span<const EventView> group) noexcept {
  std::array<EventRef, kGroupSizeMax> held;
  for (std::size_t i = 0; i < group.size(); ++i) {
    held[i] = store_->put(group[i]);
    // Large events exhaust the store before the queue is full.
    while (!held[i] && !queue_.empty()) {
      losses_.memory_count += queue_.drop_front();
      held[i] = store_->put(group[i]);
    }
  }
  const auto taken = std::span(held).first(group.size());
  if (!is_whole(taken)) {
    losses_.memory_count += group.size();
    return true;
  }
  return queue_.push(taken, losses_);
}

void LocalQueue::take_front() {
  group_.clear();
  held_.clear();
  bool is_continued = true;
  while (is_continued && !queue_.empty()) {
    EventView view = queue_[0].event.view();
    is_continued = queue_[0].is_continued;
    view.header.is_continued = is_continued;
    group_.push_back(view);
    held_.push_back(queue_[0].event);
    queue_.pop();
  }
}

}  // namespace rtpm::events
