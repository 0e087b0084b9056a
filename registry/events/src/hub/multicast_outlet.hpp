#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "broadcast/multicast.hpp"
#include "exchange/exchange.hpp"
#include "hub/ring_outlet.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events {

/// The sending end of a hub's multicast.
/// @threads  one at a time, under the hub's lock
/// @realtime alloc-free; one syscall per datagram
class MulticastOutlet final : public Broadcaster {
 public:
  /// Opens the sender, for payloads of up to `payload_size_max` and `subscription_count_max`
  /// subscriptions.
  /// @errors   those of transport::MulticastSender::open()
  [[nodiscard]] static expected<std::unique_ptr<MulticastOutlet>, SetupError> make(
      const MulticastConfig& config, std::uint32_t payload_size_max,
      std::uint32_t subscription_count_max);

  [[nodiscard]] std::uint64_t id() const noexcept { return writer_.id(); }
  [[nodiscard]] const transport::MulticastGroup& group() const noexcept { return config_.group; }
  /// Sets where events that do not fit the history are counted.
  void count_losses_in(Exchange& exchange) noexcept { exchange_ = &exchange; }

  void broadcast(std::span<const SubscriptionNumber> subscriptions,
                 std::span<const EventRef> group) noexcept override;
  /// The first datagram for a subscription `owner` that starts now.
  [[nodiscard]] std::uint64_t begin_slot(SubscriptionNumber number, std::uint64_t owner) noexcept;
  void end_slot(SubscriptionNumber number) noexcept { slots_[number] = {}; }
  [[nodiscard]] bool has_slot(SubscriptionNumber number) const noexcept {
    return slots_[number].is_used;
  }
  /// Events written for a subscription so far.
  [[nodiscard]] std::uint64_t written_count(SubscriptionNumber number) const noexcept {
    return slots_[number].written_count;
  }
  [[nodiscard]] const MulticastWriter& writer() const noexcept { return writer_; }

  /// When on_time() is due; kNever if not before the next event.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return next_heartbeat_; }
  /// Sends a heartbeat, which reveals the loss of the last datagram, at increasing intervals.
  void on_time(MonotonicTime now) noexcept;

 private:
  struct Slot {
    bool is_used = false;
    std::uint32_t owner = 0;
    std::uint64_t written_count = 0;
  };
  MulticastOutlet(const MulticastConfig& config, transport::MulticastSender sender,
                  std::uint32_t payload_size_max, std::uint32_t subscription_count_max);
  void write(std::span<const SubscriptionNumber> subscriptions, ConstBytes events,
             std::size_t event_count) noexcept;

  const MulticastConfig config_;
  transport::MulticastSender sender_;
  MulticastWriter writer_;
  std::vector<Slot> slots_;             ///< Indexed by the subscription's number.
  std::vector<std::uint64_t> encoded_;  ///< The buffer for one delivery.
  Exchange* exchange_ = nullptr;
  MonotonicTime next_heartbeat_ = kNever;
  Duration heartbeat_interval_{0};
};

/// Distributes deliveries to ring and multicast, by subscription.
class Broadcasts final : public Broadcaster {
 public:
  /// Either may be null.
  Broadcasts(RingOutlet* ring, MulticastOutlet* multicast, std::uint32_t subscription_count_max);
  void broadcast(std::span<const SubscriptionNumber> subscriptions,
                 std::span<const EventRef> group) noexcept override;

 private:
  RingOutlet* ring_;
  MulticastOutlet* multicast_;
  std::vector<SubscriptionNumber> of_ring_;
  std::vector<SubscriptionNumber> of_multicast_;
};

}  // namespace rtpm::events
