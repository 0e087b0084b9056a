#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "event_store.hpp"
#include "exchange/delivery_queue.hpp"
#include "exchange/gate.hpp"
#include "exchange/history.hpp"
#include "filter/compiled_filter.hpp"
#include "filter/index.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/events/limits.hpp"

namespace rtpm::events {

/// Slot of a subscription, below ExchangeLimits::subscription_count_max.
using SubscriptionNumber = std::uint32_t;

/// Delivers an event to many subscriptions at once, instead of through their queues.
class Broadcaster {
 public:
  virtual ~Broadcaster() = default;
  /// Delivers the events of `group` to `subscriptions`.
  virtual void broadcast(std::span<const SubscriptionNumber> subscriptions,
                         std::span<const EventRef> group) noexcept = 0;
};

/// Why an event was refused.
enum class OfferError : std::uint8_t {
  kBadType,   ///< The type is 0, or above kEventTypeMax.
  kTooLarge,  ///< The payload exceeds EventStore::payload_size_max().
  kNoMemory,  ///< Nothing is left to evict.
};

/// Counters of a subscription.
struct SubscriptionCounters {
  std::uint64_t accepted_count = 0;   ///< Deliveries that its filter accepted.
  std::uint64_t omitted_count = 0;    ///< Accepted deliveries that its policy omitted.
  std::uint64_t delivered_count = 0;  ///< Deliveries queued or broadcast.
  Losses losses{};
};

/// The core of a hub: matches events with subscriptions and queues them. Uses no socket, thread or
/// clock.
/// @ownership its memory, allocated at construction or by prepare()
/// @realtime alloc-free except construction and prepare()
class Exchange {
 public:
  /// `broadcaster` may be null if no subscription uses broadcast.
  explicit Exchange(const ExchangeLimits& limits = {}, Broadcaster* broadcaster = nullptr);
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// A compiled subscription, ready for subscribe() or change().
  struct Prepared {
    CompiledFilter filter{};
    Gate gate{};
    DeliveryQueue queue{};
    std::uint32_t replay = 0;
    bool is_broadcast = false;
    void release_events() noexcept {
      filter.release_events();
      gate.release_events();
      queue.release_events();
    }
  };
  /// @realtime set-up only; static, so that no lock is held meanwhile
  /// @errors   those of CompiledFilter::compile() and Gate::make()
  [[nodiscard]] static expected<Prepared, SetupError> prepare(const Filter& filter,
                                                              const DeliveryPolicy& policy,
                                                              const DescriptorSource& types,
                                                              bool is_broadcast = false);

  /// Adds a subscription and replays its history; nullopt if no slot is free, or too few interests
  /// are left.
  [[nodiscard]] std::optional<SubscriptionNumber> subscribe(Prepared prepared,
                                                            MonotonicTime now) noexcept;
  /// The number of the next subscription; nullopt if no slot is free.
  [[nodiscard]] std::optional<SubscriptionNumber> next_number() const noexcept {
    if (free_.empty()) return std::nullopt;
    return free_.back();
  }
  /// Replaces filter and policy. Keeps the queue; conjunctions and timeouts start over. False,
  /// without any change, if too few interests are left. Otherwise swaps the old ones into
  /// `prepared`, for the caller to free.
  [[nodiscard]] bool change(SubscriptionNumber number, Prepared& prepared,
                            MonotonicTime now) noexcept;
  /// Ends the subscription and drops its queue. The caller frees the result.
  [[nodiscard]] Prepared unsubscribe(SubscriptionNumber number) noexcept;
  /// While suspended, accepted events are lost and counted.
  void set_suspended(SubscriptionNumber number, bool is_suspended) noexcept;

  /// Matches and queues a supplier's event; its header contains the time of receipt.
  [[nodiscard]] expected<void, OfferError> offer(const EventView& event,
                                                 MonotonicTime now) noexcept;
  /// Offers an event from the hub itself, with a type above kEventTypeMax.
  /// @errors   those of offer()
  [[nodiscard]] expected<void, OfferError> publish(const EventView& event,
                                                   MonotonicTime now) noexcept;
  /// Runs the timeouts that are due.
  void on_time(MonotonicTime now) noexcept;
  /// When on_time() is due; kNever if only after another call. Linear in the subscriptions with
  /// timeouts or intervals.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// The next subscription that has a new delivery or must end.
  [[nodiscard]] std::optional<SubscriptionNumber> take_ready() noexcept;
  /// The subscription's pending events.
  [[nodiscard]] DeliveryQueue& queue(SubscriptionNumber number) noexcept {
    return subscriptions_[number].prepared.queue;
  }
  /// Whether its queue overflowed with QueuePolicy::kDisconnect; then report that and unsubscribe
  /// it.
  [[nodiscard]] bool has_failed(SubscriptionNumber number) const noexcept {
    return subscriptions_[number].has_failed;
  }
  [[nodiscard]] bool is_broadcast(SubscriptionNumber number) const noexcept {
    return subscriptions_[number].prepared.is_broadcast;
  }
  [[nodiscard]] Losses& losses(SubscriptionNumber number) noexcept {
    return subscriptions_[number].counters.losses;
  }
  [[nodiscard]] SubscriptionCounters counters(SubscriptionNumber number) const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] const EventStore& store() const noexcept { return store_; }

 private:
  struct Subscription {
    Prepared prepared{};
    SubscriptionCounters counters{};
    std::uint64_t seen = 0;  ///< The number of the last event offered to it.
    bool is_used = false;
    bool is_suspended = false;
    bool is_ready = false;
    bool is_listed = false;  ///< It is in ready_, even if no longer ready.
    bool has_failed = false;
    bool is_timed = false;
  };

  [[nodiscard]] EventRef hold(const EventView& event) noexcept;
  [[nodiscard]] bool trim_longest_queue() noexcept;
  void match(const EventRef& event, MonotonicTime now) noexcept;
  void show(SubscriptionNumber number, const EventRef& event, bool is_decided,
            MonotonicTime now) noexcept;
  void deliver(SubscriptionNumber number, const EventRef& event, const Group& group,
               MonotonicTime now) noexcept;
  void deliver_group(SubscriptionNumber number, std::span<const EventRef> group) noexcept;
  void replay(SubscriptionNumber number, MonotonicTime now) noexcept;
  void run_timers(SubscriptionNumber number, MonotonicTime now) noexcept;
  void enter(SubscriptionNumber number, MonotonicTime now) noexcept;
  void leave(SubscriptionNumber number) noexcept;
  void mark_ready(SubscriptionNumber number) noexcept;

  EventStore store_;
  History history_;
  SubscriptionIndex index_;
  Broadcaster* broadcaster_;
  std::vector<Subscription> subscriptions_;
  std::vector<SubscriptionNumber> free_;
  std::vector<SubscriptionNumber> timed_;
  std::vector<SubscriptionNumber> ready_;  ///< A ring with a slot for each subscription.
  std::size_t ready_head_ = 0;
  std::size_t ready_count_ = 0;
  std::vector<SubscriptionNumber> broadcast_to_;
  Group group_{};
  std::uint64_t event_number_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rtpm::events
