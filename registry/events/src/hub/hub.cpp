#include "rtpm/events/hub.hpp"

#include <algorithm>
#include <array>

#include "hub/hub_impl.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// How often silent disconnects are checked.
constexpr Duration kSweepInterval = 250ms;
// How often backlogged consumers are retried.
constexpr Duration kBacklogInterval = 1ms;
constexpr std::uint32_t kRingSize = 4 * 1024 * 1024;
// Events matched per locking, so that concurrent suppliers get their turn.
constexpr int kEventsPerTurn = 16;
constexpr transport::SourceTag kDoor{transport::SourceKind{1}};

DisconnectReason reason_of(rpc::CallEnding ending) noexcept {
  return ending == rpc::CallEnding::kSilent ? DisconnectReason::kSilent : DisconnectReason::kLeft;
}

}  // namespace

expected<std::unique_ptr<Hub>, SetupError> Hub::create(const HubConfig& config) {
  auto wait_set = transport::WaitSet::open(1);
  if (!wait_set) return unexpected{std::move(wait_set.error())};
  std::uint32_t payload_size_max = 0;
  for (const auto& each : config.limits.store.classes)
    payload_size_max = std::max(payload_size_max, each.payload_size_max);
  std::unique_ptr<RingOutlet> ring;
  const std::uint32_t own_size = transport::offers_broadcast_memory() ? kRingSize : 0;
  if (const std::uint32_t size = config.ring_size.value_or(own_size); size != 0) {
    auto made = RingOutlet::make(size, payload_size_max);
    if (!made) return unexpected{std::move(made.error())};
    ring = std::move(*made);
  }
  std::unique_ptr<MulticastOutlet> multicast;
  if (config.multicast) {
    auto made = MulticastOutlet::make(*config.multicast, payload_size_max,
                                      config.limits.subscription_count_max);
    if (!made) return unexpected{std::move(made.error())};
    multicast = std::move(*made);
  }
  auto hub = std::make_unique<HubImpl>(config, std::move(*wait_set), std::move(ring),
                                       std::move(multicast));
  if (auto started = hub->start(config); !started) return unexpected{std::move(started.error())};
  return std::unique_ptr<Hub>(std::move(hub));
}

rpc::ServerConfig server_config_for(const HubConfig& config) {
  const std::uint32_t count = std::min(config.limits.subscription_count_max, 1024U);
  rpc::ServerConfig server;
  server.name = "events";
  server.session_count_max = 2 * count + 64;
  server.message_size_max = 128 * 1024;
  for (const auto& each : config.limits.store.classes) {
    server.message_size_max = std::max(server.message_size_max, 2 * each.payload_size_max);
  }
  server.deferred_call_count_max = count;
  server.stream_count_max = count;
  return server;
}

HubImpl::HubImpl(const HubConfig& config, std::unique_ptr<transport::WaitSet> wait_set,
                 std::unique_ptr<RingOutlet> ring, std::unique_ptr<MulticastOutlet> multicast)
    : epoch_(rt::random_u64()),
      clock_domain_(rt::clock_domain()),
      ring_(std::move(ring)),
      multicast_(std::move(multicast)),
      broadcasts_(ring_.get(), multicast_.get(), config.limits.subscription_count_max),
      exchange_(config.limits, multicast_ ? static_cast<Broadcaster*>(&broadcasts_) : ring_.get()),
      outlets_(config.limits.subscription_count_max),
      intake_(config.supplier_count_max, config.quota, epoch_),
      wait_set_(std::move(wait_set)) {
  if (ring_) ring_->count_losses_in(exchange_);
  if (multicast_) multicast_->count_losses_in(exchange_);
  for (LinkIntake& each : link_intakes_)
    each.meter = QuotaMeter(config.quota);
}

expected<void, SetupError> HubImpl::start(const HubConfig& config) {
  if (ring_ && !wait_set_->add(ring_->door(), kDoor, transport::Trigger::kLevel)) {
    return setup_error("The hub can't wait for readers of its ring");
  }
  auto thread = rt::Thread::start(
      {.name = "rtpm-hub", .priority = config.priority, .realtime = config.realtime},
      [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

HubImpl::~HubImpl() {
  links_.clear();
  is_stopping_.store(true, std::memory_order_release);
  wait_set_->ring();
  thread_.join();
}

void HubImpl::push(std::uint64_t supplier, ConstBytes events, Priority priority) noexcept {
  EventReader reader(events);
  bool has_more = true;
  while (has_more) {
    const WakeAfter wake_after(*this);
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    Intake::Supplier& its = intake_.find(supplier, now);
    for (int i = 0; i < kEventsPerTurn && has_more; ++i) {
      auto event = reader.next();
      has_more = event.has_value();
      if (has_more) {
        // ev-2-2: the hub sets these.
        event->header.hub_received = now;
        event->header.hub_sent = {};
        event->header.priority = priority;
        event->header.is_replayed = false;
        event->header.is_continued = false;
        event->header.supplier_tag = its.tag;
        take(its, *event, now);
      } else if (event.error() == EventError::kBroken) {
        ++its.counters.bad_count;
        ++intake_counters_.bad_count;
      }
    }
    pump_ready(now);
    ring_if_needed(now);
  }
}

void HubImpl::take(Intake::Supplier& supplier, const EventView& event, MonotonicTime now) noexcept {
  const auto count = [&](std::uint64_t IntakeCounters::*counter) {
    ++(supplier.counters.*counter);
    ++(intake_counters_.*counter);
  };
  if (!supplier.meter.take(event_span(event.payload.size()), now)) {
    return count(&IntakeCounters::over_quota_count);
  }
  const auto offered = exchange_.offer(event, now);
  if (offered) return count(&IntakeCounters::taken_count);
  switch (offered.error()) {
    case OfferError::kBadType:
      return count(&IntakeCounters::bad_count);
    case OfferError::kTooLarge:
      return count(&IntakeCounters::too_large_count);
    case OfferError::kNoMemory:
      return count(&IntakeCounters::no_memory_count);
  }
}

void HubImpl::pump_ready(MonotonicTime now) noexcept {
  while (const auto number = exchange_.take_ready())
    pump(*number, now);
  if (ring_) wake_bits_.fetch_or(ring_->take_wake_bits());
}

void HubImpl::pump(SubscriptionNumber number, MonotonicTime now) noexcept {
  Outlet& outlet = outlets_[number];
  if (outlet.is_dead) return;
  if (exchange_.has_failed(number)) {
    // The stream ends with this reason after the pending items.
    outlet.writer.fail(rpc::Refusal::kOverload);
    end(outlet, DisconnectReason::kQueueFull);
    return;
  }
  const auto outcome =
      outlet.pump(exchange_.queue(number), exchange_.losses(number), builder_, now);
  outlet.is_backlogged = outcome == Outlet::Outcome::kBacklog;
  has_backlog_ |= outlet.is_backlogged;
  if (outcome == Outlet::Outcome::kGone) end(outlet, reason_of(outlet.writer.ending()));
}

void HubImpl::end(Outlet& outlet, DisconnectReason reason) noexcept {
  outlet.is_dead = true;
  outlet.reason = reason;
  has_dead_ = true;
}

// Wakes the ring's readers once for all records, after the lock is released.
HubImpl::WakeAfter::~WakeAfter() {
  if (hub_.ring_ != nullptr) hub_.ring_->wake(hub_.wake_bits_.exchange(0));
}

MonotonicTime HubImpl::next_time() const noexcept {
  const MonotonicTime next = exchange_.next_time();
  return multicast_ ? std::min(next, multicast_->next_time()) : next;
}

// Wakes the hub's thread if something is due before its next wake-up.
void HubImpl::ring_if_needed(MonotonicTime now) noexcept {
  MonotonicTime next = next_time();
  if (has_backlog_) next = std::min(next, now + kBacklogInterval);
  if (has_dead_) next = now;
  if (next >= sleeping_until_) return;
  sleeping_until_ = MonotonicTime::min();
  wait_set_->ring();
}

void HubImpl::run() noexcept {
  std::array<transport::SourceTag, 8> tags{};
  MonotonicTime next_sweep = rt::now() + kSweepInterval;
  while (!is_stopping_.load(std::memory_order_acquire)) {
    MonotonicTime until = kNever;
    {
      const WakeAfter wake_after(*this);
      const std::lock_guard lock(mutex_);
      const MonotonicTime now = rt::now();
      exchange_.on_time(now);
      if (multicast_) multicast_->on_time(now);
      pump_ready(now);
      const bool is_sweep = now >= next_sweep;
      if (is_sweep) next_sweep = now + kSweepInterval;
      retry_backlogs(is_sweep, now);
      until = std::min(next_time(), next_sweep);
      if (has_backlog_) until = std::min(until, now + kBacklogInterval);
      sleeping_until_ = until;
    }
    reap_dead();
    const std::size_t count = wait_set_->wait(until, tags);
    if (ring_ && std::find(tags.begin(), tags.begin() + count, kDoor) != tags.begin() + count) {
      ring_->let_in();
    }
  }
}

// Retries backlogged consumers, and periodically all of them: a silent disconnect shows only when
// sending.
void HubImpl::retry_backlogs(bool is_sweep, MonotonicTime now) noexcept {
  if (!has_backlog_ && !is_sweep) return;
  has_backlog_ = false;
  for (SubscriptionNumber i = 0; i < outlets_.size(); ++i) {
    Outlet& outlet = outlets_[i];
    if (outlet.id == 0 || outlet.is_dead) continue;
    if (is_sweep && !outlet.writer.is_awaited()) {
      end(outlet, reason_of(outlet.writer.ending()));
    } else if (outlet.is_backlogged || is_sweep) {
      pump(i, now);
    }
  }
}

// Frees dead subscriptions one at a time, and their memory outside the lock.
void HubImpl::reap_dead() noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(has_dead_, false)) return;
  }
  for (SubscriptionNumber i = 0; i < outlets_.size(); ++i) {
    Exchange::Prepared leftover;
    Outlet outlet;
    {
      const std::lock_guard lock(mutex_);
      if (outlets_[i].id == 0 || !outlets_[i].is_dead) continue;
      if (receives_multicast(i)) {
        multicast_->end_slot(i);
      } else if (exchange_.is_broadcast(i)) {
        ring_->end_slot(i);
      }
      leftover = exchange_.unsubscribe(i);
      std::swap(outlet, outlets_[i]);
    }
    remove_interest_set(outlet.id);
    disconnects_.note(outlet.name, outlet.reason, rt::now());
  }
}

expected<void, SetupError> HubImpl::add_type(const EventDescriptor& descriptor) {
  const std::lock_guard lock(types_mutex_);
  return types_.add(descriptor);
}

IntakeCounters HubImpl::intake() const noexcept {
  const std::lock_guard lock(mutex_);
  return intake_counters_;
}

std::size_t HubImpl::subscription_count() const noexcept {
  const std::lock_guard lock(mutex_);
  return exchange_.size();
}

}  // namespace rtpm::events
