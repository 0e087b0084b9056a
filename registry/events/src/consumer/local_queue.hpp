#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "event_store.hpp"
#include "exchange/delivery_queue.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/events/filter.hpp"

namespace rtpm::events {

/// What a consumer's look at memory or a socket of its own brought.
enum class SessionOutcome : std::uint8_t {
  kDelivered,
  kNothing,
  kGone,          ///< The hub has given the place up.
  kBroken,        ///< The hub does not keep to the rules.
  kFallenBehind,  ///< The queue is full and the policy is to disconnect then.
};

/// The queue of a consumer whose events do not wait at the hub: does here by itself what the hub
/// would do there, and drops what the policy says when the handler does not keep up.
/// @ownership copies of the events
/// @threads  one
/// @realtime alloc-free but for set_policy()
class LocalQueue {
 public:
  LocalQueue();
  /// Another policy; what waits stays as far as there is room.
  void set_policy(const DeliveryPolicy& policy);

  /// Queues a delivery; false if the queue is full and the policy is to disconnect then.
  [[nodiscard]] bool push(std::span<const EventView> group) noexcept;
  [[nodiscard]] bool empty() const noexcept { return queue_.empty(); }
  /// Takes one delivery, if there is one, and calls deliver(span of EventView) with it.
  template <class Deliver>
  [[nodiscard]] bool take(Deliver deliver) {
    if (queue_.empty()) return false;
    take_front();
    deliver(std::span<const EventView>(group_));
    held_.clear();
    return true;
  }
  [[nodiscard]] const Losses& losses() const noexcept { return losses_; }

 private:
  void take_front();

  std::unique_ptr<EventStore> store_{};  ///< Outlives the references below.
  DeliveryQueue queue_{};
  std::vector<EventView> group_{};
  std::vector<EventRef> held_{};
  Losses losses_{};
};

}  // namespace rtpm::events
