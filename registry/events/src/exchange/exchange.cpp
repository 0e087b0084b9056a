#include "exchange/exchange.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/base/assert.hpp"

namespace rtpm::events {

Exchange::Exchange(const ExchangeLimits& limits, Broadcaster* broadcaster)
    : store_(limits.store),
      history_(limits.history_key_count_max, limits.history_depth),
      index_(limits.interest_count_max),
      broadcaster_(broadcaster),
      subscriptions_(limits.subscription_count_max) {
  free_.reserve(subscriptions_.size());
  for (std::size_t i = subscriptions_.size(); i-- > 0;)
    free_.push_back(static_cast<SubscriptionNumber>(i));
  timed_.reserve(subscriptions_.size());
  ready_.resize(subscriptions_.size());
  broadcast_to_.reserve(subscriptions_.size());
}

expected<Exchange::Prepared, SetupError> Exchange::prepare(const Filter& filter,
                                                           const DeliveryPolicy& policy,
                                                           const DescriptorSource& types,
                                                           bool is_broadcast) {
  auto compiled = CompiledFilter::compile(filter, types);
  if (!compiled) return unexpected{std::move(compiled.error())};
  auto gate = Gate::make(policy, types);
  if (!gate) return unexpected{std::move(gate.error())};
  Prepared prepared{std::move(*compiled), std::move(*gate), {}, policy.replay, is_broadcast};
  if (!is_broadcast) prepared.queue = DeliveryQueue(policy.when_full, policy.queue_capacity);
  return prepared;
}

void Exchange::enter(SubscriptionNumber number, MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  const CompiledFilter& compiled = subscription.prepared.filter;
  const bool is_added = index_.add(number, compiled.interests(), compiled.is_decided_by_interest());
  RTPM_ASSERT(is_added, "there was room in the index");
  subscription.prepared.filter.start(now);
  if (!compiled.has_timeouts() && !subscription.prepared.gate.has_interval()) return;
  subscription.is_timed = true;
  timed_.push_back(number);
}

void Exchange::leave(SubscriptionNumber number) noexcept {
  Subscription& subscription = subscriptions_[number];
  index_.remove(number, subscription.prepared.filter.interests());
  if (std::exchange(subscription.is_timed, false)) std::erase(timed_, number);
}

std::optional<SubscriptionNumber> Exchange::subscribe(Prepared prepared,
                                                      MonotonicTime now) noexcept {
  if (free_.empty() || !index_.has_room(prepared.filter.interests().size())) return std::nullopt;
  RTPM_ASSERT(!prepared.is_broadcast || broadcaster_ != nullptr, "there is a broadcaster");
  const SubscriptionNumber number = free_.back();
  free_.pop_back();
  Subscription& subscription = subscriptions_[number];
  subscription.prepared = std::move(prepared);
  subscription.counters = {};
  subscription.seen = 0;
  subscription.is_used = true;
  subscription.is_suspended = false;
  subscription.has_failed = false;
  ++size_;
  enter(number, now);
  replay(number, now);
  return number;
}

bool Exchange::change(SubscriptionNumber number, Prepared& prepared, MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  const std::size_t freed = subscription.prepared.filter.interests().size();
  const std::size_t needed = prepared.filter.interests().size();
  if (needed > freed && !index_.has_room(needed - freed)) return false;
  leave(number);
  prepared.is_broadcast = subscription.prepared.is_broadcast;
  if (!prepared.is_broadcast &&
      !prepared.queue.take_over(subscription.prepared.queue, subscription.counters.losses)) {
    subscription.has_failed = true;
    mark_ready(number);
  }
  std::swap(subscription.prepared, prepared);
  prepared.release_events();
  enter(number, now);
  return true;
}

Exchange::Prepared Exchange::unsubscribe(SubscriptionNumber number) noexcept {
  Subscription& subscription = subscriptions_[number];
  RTPM_ASSERT(subscription.is_used, "a subscription ends once");
  leave(number);
  subscription.is_ready = false;
  subscription.is_used = false;
  subscription.prepared.release_events();
  free_.push_back(number);
  --size_;
  return std::exchange(subscription.prepared, {});
}

void Exchange::set_suspended(SubscriptionNumber number, bool is_suspended) noexcept {
  subscriptions_[number].is_suspended = is_suspended;
}

// Stores the event. If memory is exhausted, evicts history first, then from the longest queue, that
// of the slowest consumer.
EventRef Exchange::hold(const EventView& event) noexcept {
  if (EventRef held = store_.put(event)) return held;
  if (event.payload.size() > store_.payload_size_max()) return {};
  EventRef held;
  const auto try_again = [&] {
    held = store_.put(event);
    return static_cast<bool>(held);
  };
  history_.evict_until(try_again);
  while (!held && trim_longest_queue())
    held = store_.put(event);
  return held;
}

// Drops half of the queue, so that this does not run for each event.
bool Exchange::trim_longest_queue() noexcept {
  const auto longest = std::ranges::max_element(
      subscriptions_, {}, [](const Subscription& each) { return each.prepared.queue.size(); });
  if (longest == subscriptions_.end() || longest->prepared.queue.empty()) return false;
  DeliveryQueue& queue = longest->prepared.queue;
  const std::size_t wanted = queue.size() / 2;
  while (queue.size() > wanted)
    longest->counters.losses.memory_count += queue.drop_front();
  return true;
}

expected<void, OfferError> Exchange::offer(const EventView& event, MonotonicTime now) noexcept {
  if (event.header.type == 0 || event.header.type > kEventTypeMax) {
    return unexpected{OfferError::kBadType};
  }
  return publish(event, now);
}

expected<void, OfferError> Exchange::publish(const EventView& event, MonotonicTime now) noexcept {
  if (event.payload.size() > store_.payload_size_max()) return unexpected{OfferError::kTooLarge};
  const EventRef held = hold(event);
  if (!held) return unexpected{OfferError::kNoMemory};
  match(held, now);
  history_.add(held);
  return {};
}

void Exchange::match(const EventRef& event, MonotonicTime now) noexcept {
  const std::uint64_t number = ++event_number_;
  index_.visit(
      event.header().type, event.header().source,
      [&](SubscriptionNumber subscription, bool is_decided, bool may_repeat) {
        if (may_repeat && std::exchange(subscriptions_[subscription].seen, number) == number) {
          return;
        }
        show(subscription, event, is_decided, now);
      });
  if (broadcast_to_.empty()) return;
  broadcaster_->broadcast(broadcast_to_, std::span(&event, 1));
  broadcast_to_.clear();
}

void Exchange::show(SubscriptionNumber number, const EventRef& event, bool is_decided,
                    MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  if (is_decided || subscription.prepared.filter.on_event(event, now, group_)) {
    deliver(number, event, group_, now);
  }
  group_.clear();
}

// An empty group means the event alone.
void Exchange::deliver(SubscriptionNumber number, const EventRef& event, const Group& group,
                       MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  ++subscription.counters.accepted_count;
  if (subscription.is_suspended) {
    subscription.counters.losses.suspended_count += std::max<std::size_t>(group.size(), 1);
    return;
  }
  const bool is_alone = group.size() == 0;
  if (!subscription.prepared.gate.admit(is_alone ? event : EventRef(), now)) return;
  if (is_alone && subscription.prepared.is_broadcast) {
    ++subscription.counters.delivered_count;
    broadcast_to_.push_back(number);
    return;
  }
  deliver_group(number, is_alone ? std::span(&event, 1) : std::span(group.begin(), group.size()));
}

void Exchange::deliver_group(SubscriptionNumber number, std::span<const EventRef> group) noexcept {
  Subscription& subscription = subscriptions_[number];
  ++subscription.counters.delivered_count;
  if (subscription.prepared.is_broadcast) {
    broadcaster_->broadcast(std::span(&number, 1), group);
    return;
  }
  if (!subscription.prepared.queue.push(group, subscription.counters.losses)) {
    subscription.has_failed = true;
  }
  mark_ready(number);
}

void Exchange::mark_ready(SubscriptionNumber number) noexcept {
  Subscription& subscription = subscriptions_[number];
  subscription.is_ready = true;
  if (std::exchange(subscription.is_listed, true)) return;
  ready_[(ready_head_ + ready_count_++) % ready_.size()] = number;
}

std::optional<SubscriptionNumber> Exchange::take_ready() noexcept {
  while (ready_count_ > 0) {
    const SubscriptionNumber number = ready_[ready_head_];
    ready_head_ = (ready_head_ + 1) % ready_.size();
    --ready_count_;
    subscriptions_[number].is_listed = false;
    if (std::exchange(subscriptions_[number].is_ready, false)) return number;
  }
  return std::nullopt;
}

// Replayed events pass the filter but not the gate: the replay count is the only limit.
void Exchange::replay(SubscriptionNumber number, MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  if (subscription.prepared.replay == 0) return;
  history_.visit_last(subscription.prepared.replay, [&](const EventRef& past) {
    if (!subscription.prepared.filter.on_event(past, now, group_)) return;
    EventHeader header = past.header();
    header.is_replayed = true;
    // A copy, because is_replayed is set for this subscription only.
    const EventRef copy = group_.size() == 0 ? store_.put({header, past.payload()}) : EventRef();
    if (copy) {
      deliver_group(number, std::span(&copy, 1));
    } else if (group_.size() > 0) {
      deliver_group(number, std::span(group_.begin(), group_.size()));
    } else {
      ++subscription.counters.losses.memory_count;
    }
    group_.clear();
  });
}

void Exchange::on_time(MonotonicTime now) noexcept {
  for (std::size_t i = 0; i < timed_.size(); ++i)
    run_timers(timed_[i], now);
}

void Exchange::run_timers(SubscriptionNumber number, MonotonicTime now) noexcept {
  Subscription& subscription = subscriptions_[number];
  while (const EventRef held = subscription.prepared.gate.take_held(now)) {
    deliver_group(number, std::span(&held, 1));
  }
  while (const auto due = subscription.prepared.filter.take_due(now)) {
    const EventView notice{{.type = kTimeoutType,
                            .source = due->tag,
                            .sequence = due->count,
                            .origin = due->time,
                            .hub_received = now},
                           {}};
    const EventRef event = hold(notice);
    if (!event) {
      ++subscription.counters.losses.memory_count;
      continue;
    }
    if (subscription.prepared.filter.on_timeout(*due, event, now, group_)) {
      ++subscription.counters.accepted_count;
      if (subscription.is_suspended) {
        subscription.counters.losses.suspended_count += group_.size();
      } else {
        deliver_group(number, std::span(group_.begin(), group_.size()));
      }
    }
    group_.clear();
  }
}

MonotonicTime Exchange::next_time() const noexcept {
  MonotonicTime next = kNever;
  for (const SubscriptionNumber number : timed_) {
    const Prepared& prepared = subscriptions_[number].prepared;
    next = std::min({next, prepared.filter.next_time(), prepared.gate.next_time()});
  }
  return next;
}

SubscriptionCounters Exchange::counters(SubscriptionNumber number) const noexcept {
  SubscriptionCounters counters = subscriptions_[number].counters;
  counters.omitted_count = subscriptions_[number].prepared.gate.omitted_count();
  return counters;
}

}  // namespace rtpm::events
