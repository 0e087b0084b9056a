#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "broadcast/ring.hpp"
#include "exchange/exchange.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/broadcast_memory.hpp"

namespace rtpm::events {

/// The hub's end of the ring for consumers on its host.
/// @threads  broadcast() and take_wake_bits(): under the hub's lock; wake(): any; let_in(): one
///           thread
class RingOutlet final : public Broadcaster {
 public:
  /// Creates a ring with `size` bytes of records, for events of up to `payload_size_max`.
  /// @realtime set-up only
  [[nodiscard]] static expected<std::unique_ptr<RingOutlet>, SetupError> make(
      std::uint32_t size, std::uint32_t payload_size_max);

  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  /// Sets where events that do not fit the ring are counted.
  void count_losses_in(Exchange& exchange) noexcept { exchange_ = &exchange; }

  void broadcast(std::span<const SubscriptionNumber> subscriptions,
                 std::span<const EventRef> group) noexcept override;
  /// The position of the first event for a subscription that starts now.
  [[nodiscard]] std::uint64_t begin_slot(SubscriptionNumber number, std::uint64_t owner) noexcept {
    writer_.begin_slot(number, owner);
    return writer_.position();
  }
  void end_slot(SubscriptionNumber number) noexcept { writer_.end_slot(number); }
  /// Wake bits for records written since the last call.
  [[nodiscard]] std::uint32_t take_wake_bits() noexcept { return std::exchange(wake_bits_, 0); }
  void wake(std::uint32_t bits) noexcept {
    if (bits != 0) memory_.bell().ring(bits);
  }

  /// A descriptor that is readable when a reader requests the memory; then call let_in().
  [[nodiscard]] int door() const noexcept { return door_.descriptor(); }
  void let_in() noexcept { door_.let_in(memory_); }

 private:
  RingOutlet(std::uint64_t id, transport::BroadcastMemory memory, transport::BroadcastDoor door,
             std::uint32_t payload_size_max);

  std::uint64_t id_;
  transport::BroadcastMemory memory_;
  transport::BroadcastDoor door_;
  RingWriter writer_;
  std::vector<std::uint64_t> encoded_;  ///< The buffer for one delivery.
  Exchange* exchange_ = nullptr;
  std::uint32_t wake_bits_ = 0;
};

}  // namespace rtpm::events
