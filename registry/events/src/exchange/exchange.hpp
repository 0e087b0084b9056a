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

/// A place for one subscription, below ExchangeLimits::subscription_count_max.
using SubscriptionNumber = std::uint32_t;

/// Where deliveries go that do not wait in a queue of their own: memory that many read at once.
class Broadcaster {
 public:
  virtual ~Broadcaster() = default;
  /// Gives the events of `group` to `subscriptions`, all of them at once.
  /// @realtime alloc-free
  virtual void broadcast(std::span<const SubscriptionNumber> subscriptions,
                         std::span<const EventRef> group) noexcept = 0;
};

/// Why an event was not taken.
enum class OfferError : std::uint8_t {
  kBadType,   ///< 0, or above kEventTypeMax. Its supplier's bug.
  kTooLarge,  ///< More payload than EventStore::payload_size_max(). Send it in parts.
  kNoMemory,  ///< Nothing is left to give up. Give the hub more memory.
};

/// What a subscription got and missed.
struct SubscriptionCounters {
  std::uint64_t accepted_count = 0;   ///< By its filter: deliveries.
  std::uint64_t omitted_count = 0;    ///< Of these, left out as its policy wants.
  std::uint64_t delivered_count = 0;  ///< Queued or broadcast.
  Losses losses{};
};

/// Who wants what: takes events, matches them with subscriptions and queues them for each. It knows
/// no socket, no thread and no clock.
/// @ownership all its memory, taken when built or when a subscription is made
/// @threads  one at a time
/// @realtime alloc-free but for construction, subscribe() and change()
class Exchange {
 public:
  /// `broadcaster` may be null; then nobody subscribes to it.
  explicit Exchange(const ExchangeLimits& limits = {}, Broadcaster* broadcaster = nullptr);
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// A subscription that was checked, ready to go in. Making one is set-up; putting it in is not.
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
  /// @realtime set-up only; needs no exchange, so that nobody waits for it
  /// @errors   as CompiledFilter::compile() and Gate::make()
  [[nodiscard]] static expected<Prepared, FilterError> prepare(const Filter& filter,
                                                               const DeliveryPolicy& policy,
                                                               const DescriptorSource& types,
                                                               bool is_broadcast = false);

  /// Puts a subscription in, and replays what it wants; nothing if there is no place, or too few
  /// interests are left.
  [[nodiscard]] std::optional<SubscriptionNumber> subscribe(Prepared prepared,
                                                            MonotonicTime now) noexcept;
  /// The number that the next subscription gets; nothing if there is no place.
  [[nodiscard]] std::optional<SubscriptionNumber> next_number() const noexcept {
    if (free_.empty()) return std::nullopt;
    return free_.back();
  }
  /// Puts another filter and policy in the place of the present ones at once: each event is judged
  /// by the one or the other, and what waits in the queue still comes. Conjunctions and timeouts
  /// begin anew. False if too few interests are left: nothing is changed. Else `prepared` is what
  /// was there before, to be freed where freeing is allowed.
  [[nodiscard]] bool change(SubscriptionNumber number, Prepared& prepared,
                            MonotonicTime now) noexcept;
  /// Ends the subscription; its queue is dropped. What is left of it is freed by whoever gets it.
  [[nodiscard]] Prepared unsubscribe(SubscriptionNumber number) noexcept;
  /// While suspended, what the filter accepts is lost, and counted as that.
  void set_suspended(SubscriptionNumber number, bool is_suspended) noexcept;

  /// Takes an event, whose header says when it was received, and queues it for all that want it.
  [[nodiscard]] expected<void, OfferError> offer(const EventView& event,
                                                 MonotonicTime now) noexcept;
  /// Takes what the hub itself tells: an event whose type is above kEventTypeMax.
  /// @errors   as offer()
  [[nodiscard]] expected<void, OfferError> publish(const EventView& event,
                                                   MonotonicTime now) noexcept;
  /// Lets the timeouts act that are due.
  void on_time(MonotonicTime now) noexcept;
  /// When on_time() has something to do; kNever: not until another call. Linear in the number of
  /// subscriptions with timeouts or intervals.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// The next subscription that got something since it was last taken here, or that must end.
  [[nodiscard]] std::optional<SubscriptionNumber> take_ready() noexcept;
  /// What waits for it; take it by pop().
  [[nodiscard]] DeliveryQueue& queue(SubscriptionNumber number) noexcept {
    return subscriptions_[number].prepared.queue;
  }
  /// Its queue ran over and its policy is to end then: tell it so, and unsubscribe.
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
    std::uint64_t seen = 0;  ///< The last event that it was shown.
    bool is_used = false;
    bool is_suspended = false;
    bool is_ready = false;
    bool is_listed = false;  ///< It stands in ready_, ready or not.
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
  std::vector<SubscriptionNumber> ready_;  ///< A ring of as many places as subscriptions.
  std::size_t ready_head_ = 0;
  std::size_t ready_count_ = 0;
  std::vector<SubscriptionNumber> broadcast_to_;
  Group group_{};
  std::uint64_t event_number_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rtpm::events
