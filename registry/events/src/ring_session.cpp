#include "ring_session.hpp"

#include <algorithm>
#include <array>

#include "rtpm/rt/clock.hpp"

namespace rtpm::events {
namespace {

// So many records are taken into the queue in one go; then the handler has its turn.
constexpr int kRecordsPerTurn = 4096;

StoreConfig store_for(std::uint32_t capacity) {
  const std::uint32_t count = capacity + kGroupSizeMax;
  return {{{256, count}, {4096, std::min(count, 128U)}, {65'536, 16}, {1'048'576, 2}}};
}

}  // namespace

std::unique_ptr<RingSession> RingSession::open(std::uint64_t id, MonotonicTime deadline) {
  auto view = transport::BroadcastView::open(id, deadline);
  if (!view || !RingReader::is_ring(view->bytes(), id)) return nullptr;
  return std::unique_ptr<RingSession>(new RingSession(std::move(*view), id));
}

void RingSession::begin(std::uint32_t place, std::uint64_t owner, std::uint64_t position,
                        const DeliveryPolicy& policy) {
  reader_.emplace(view_.bytes(), place, owner, position);
  group_.reserve(kGroupSizeMax);
  held_.reserve(kGroupSizeMax);
  set_policy(policy);
}

void RingSession::set_policy(const DeliveryPolicy& policy) {
  policy_ = policy;
  direct_max_ = policy.when_full == QueuePolicy::kKeepLatest ? 1 : policy.queue_capacity;
  auto store = std::make_unique<EventStore>(store_for(policy.queue_capacity));
  DeliveryQueue queue(policy.when_full, policy.queue_capacity);
  while (!queue_.empty()) {
    std::array<EventRef, kGroupSizeMax> group;
    std::size_t count = 0;
    for (bool is_continued = true; is_continued && count < group.size(); queue_.pop()) {
      is_continued = queue_[0].is_continued;
      group[count++] = store->put(queue_[0].event.view());
    }
    const bool is_whole = std::all_of(group.begin(), group.begin() + count,
                                      [](const EventRef& each) { return static_cast<bool>(each); });
    // A queue that is to end the subscription when it is full ends it with the next event.
    if (!is_whole || !queue.push(std::span(group).first(count), losses_)) {
      losses_.overflow_count += count;
    }
  }
  queue_ = std::move(queue);
  store_ = std::move(store);
}

bool RingSession::parse() noexcept {
  group_.clear();
  EventReader events(reader_->events());
  auto event = events.next();
  for (; event && group_.size() < kGroupSizeMax; event = events.next())
    group_.push_back(*event);
  reader_->count_read(group_.size());
  return !event && event.error() == EventError::kEnd && !group_.empty();
}

std::optional<RingSession::Outcome> RingSession::fill_queue() {
  for (int i = 0; i < kRecordsPerTurn; ++i) {
    const RingRead read = reader_->read();
    if (read == RingRead::kNothing) break;
    if (read == RingRead::kOverrun) continue;
    if (read == RingRead::kGone) return Outcome::kGone;
    if (read == RingRead::kBroken || !parse()) return Outcome::kBroken;
    std::array<EventRef, kGroupSizeMax> group;
    for (std::size_t k = 0; k < group_.size(); ++k) {
      group[k] = store_->put(group_[k]);
      // Large ones fill the store before the queue.
      while (!group[k] && !queue_.empty()) {
        losses_.memory_count += queue_.drop_front();
        group[k] = store_->put(group_[k]);
      }
    }
    const auto whole = std::span(group).first(group_.size());
    if (!std::ranges::all_of(whole, [](const EventRef& each) { return static_cast<bool>(each); })) {
      losses_.memory_count += whole.size();
      continue;
    }
    if (!queue_.push(whole, losses_)) return Outcome::kFallenBehind;
  }
  return std::nullopt;
}

void RingSession::take_from_queue() {
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

void RingSession::wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept {
  if (strategy == rt::WaitStrategy::kSpin) {
    while (!reader_->has_more() && rt::now() < until) {
    }
    return;
  }
  const std::uint32_t seen = reader_->word().load(std::memory_order_acquire);
  if (reader_->has_more()) return;
  transport::sleep_on_broadcast(reader_->word(), seen, reader_->wake_bits(), until);
}

Losses RingSession::losses() const noexcept {
  Losses losses = losses_;
  losses.overrun_count = reader_->missed_count();
  return losses;
}

}  // namespace rtpm::events
