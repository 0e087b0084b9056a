#include "consumer/ring_session.hpp"

#include <algorithm>

#include "broadcast/broadcast_group.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::events {
namespace {

// Records queued per turn, before the handler runs.
constexpr int kRingRecordsPerTurn = 4096;

}  // namespace

std::unique_ptr<RingSession> RingSession::open(std::uint64_t id, MonotonicTime deadline) {
  auto view = transport::BroadcastView::open(id, deadline);
  if (!view || !RingReader::is_ring(view->bytes(), id)) return nullptr;
  return std::unique_ptr<RingSession>(
      new RingSession(std::make_shared<transport::BroadcastView>(std::move(*view)), id));
}

void RingSession::begin(std::uint32_t slot, std::uint64_t owner, std::uint64_t position,
                        const DeliveryPolicy& policy) {
  reader_.emplace(view_->bytes(), slot, owner, position);
  group_.reserve(kGroupSizeMax);
  set_policy(policy);
}

void RingSession::set_policy(const DeliveryPolicy& policy) {
  direct_max_ = policy.when_full == QueuePolicy::kKeepLatest ? 1 : policy.queue_capacity;
  is_queue_ring_ =
      policy.when_full == QueuePolicy::kDropOldest && policy.queue_capacity == kQueueCapacityMax;
  queue_.set_policy(policy);
}

RingSession::Outcome RingSession::take(const Taker& taker, Asking) {
  if (is_direct()) {
    if (is_queue_ring_) reader_->catch_up();
    const RingRead read = reader_->read();
    if (read == RingRead::kNothing || read == RingRead::kOverrun) return Outcome::kNothing;
    if (read == RingRead::kGone) return Outcome::kGone;
    if (read == RingRead::kBroken || !parse()) return Outcome::kBroken;
    taker(group_);
    return Outcome::kDelivered;
  }
  if (const auto failed = fill_queue()) return *failed;
  return queue_.take(taker) ? Outcome::kDelivered : Outcome::kNothing;
}

bool RingSession::parse() noexcept {
  const bool is_sound = decode_group(reader_->events(), group_);
  reader_->count_read(group_.size());
  return is_sound;
}

std::optional<RingSession::Outcome> RingSession::fill_queue() {
  for (int i = 0; i < kRingRecordsPerTurn; ++i) {
    const RingRead read = reader_->read();
    if (read == RingRead::kNothing) break;
    if (read == RingRead::kOverrun) continue;
    if (read == RingRead::kGone) return Outcome::kGone;
    if (read == RingRead::kBroken || !parse()) return Outcome::kBroken;
    if (!queue_.push(group_)) return Outcome::kFallenBehind;
  }
  return std::nullopt;
}

void RingSession::wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept {
  if (strategy == rt::WaitStrategy::kSpin) {
    while (!reader_->has_more() && rt::now() < until) {
    }
    return;
  }
  const std::uint32_t seen = view_->bell().value();
  if (reader_->has_more()) return;
  view_->bell().sleep(seen, reader_->wake_bits(), until);
}

Losses RingSession::losses() const noexcept {
  Losses losses = queue_.losses();
  losses.overrun_count = reader_->missed_count();
  return losses;
}

}  // namespace rtpm::events
