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

/// Result of reading ring or multicast.
enum class SessionOutcome : std::uint8_t {
  kDelivered,
  kNothing,
  kGone,          ///< The hub has freed the slot.
  kBroken,        ///< Malformed data.
  kFallenBehind,  ///< The queue is full with QueuePolicy::kDisconnect.
};

/// The queue of a consumer whose events do not wait at the hub; applies the policy here.
/// @ownership copies of the events
/// @realtime alloc-free except set_policy()
class LocalQueue {
 public:
  LocalQueue();
  /// Replaces the policy; keeps pending events that fit.
  void set_policy(const DeliveryPolicy& policy);

  /// Appends a delivery; false if the queue is full with QueuePolicy::kDisconnect.
  [[nodiscard]] bool push(std::span<const EventView> group) noexcept;
  [[nodiscard]] bool empty() const noexcept { return queue_.empty(); }
  /// Removes one delivery, if any, and calls deliver(span of EventView).
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
