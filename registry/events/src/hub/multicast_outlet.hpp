#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "broadcast/multicast.hpp"
#include "exchange/exchange.hpp"
#include "hub/ring_outlet.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events {

/// The multicast of a hub: where the events leave that consumers on the LAN receive together.
/// @threads  one at a time, with the hub's lock
/// @realtime alloc-free; a syscall for each datagram
class MulticastOutlet final : public Broadcaster {
 public:
  /// For events of up to `payload_size_max` and so many subscriptions.
  /// @realtime set-up only
  /// @errors   as transport::MulticastSender::open()
  [[nodiscard]] static expected<std::unique_ptr<MulticastOutlet>, transport::TransportError> make(
      const MulticastConfig& config, std::uint32_t payload_size_max,
      std::uint32_t subscription_count_max);

  [[nodiscard]] std::uint64_t id() const noexcept { return writer_.id(); }
  [[nodiscard]] const transport::MulticastGroup& group() const noexcept { return config_.group; }
  /// Lets the counts of losses be told: what does not fit the history is lost for all.
  void count_losses_in(Exchange& exchange) noexcept { exchange_ = &exchange; }

  void broadcast(std::span<const SubscriptionNumber> subscriptions,
                 std::span<const EventRef> group) noexcept override;
  /// The datagram with which a subscription begins that begins now. `owner` is its id.
  [[nodiscard]] std::uint64_t begin_slot(SubscriptionNumber number, std::uint64_t owner) noexcept;
  void end_slot(SubscriptionNumber number) noexcept { places_[number] = {}; }
  [[nodiscard]] bool has_place(SubscriptionNumber number) const noexcept {
    return places_[number].is_used;
  }
  /// Events written for a subscription so far.
  [[nodiscard]] std::uint64_t written_count(SubscriptionNumber number) const noexcept {
    return places_[number].written_count;
  }
  [[nodiscard]] const MulticastWriter& writer() const noexcept { return writer_; }

  /// When on_time() has something to do; kNever: not before the next event.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return next_heartbeat_; }
  /// Tells who missed the last datagram that there was one: soon, then at longer and longer times.
  void on_time(MonotonicTime now) noexcept;

 private:
  struct Place {
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
  std::vector<Place> places_;           ///< By the subscription's number.
  std::vector<std::uint64_t> encoded_;  ///< Room for one delivery.
  Exchange* exchange_ = nullptr;
  MonotonicTime next_heartbeat_ = kNever;
  Duration heartbeat_interval_{0};
  std::uint64_t made_count_ = 0;
};

/// Both of a hub's: gives each subscription what it wants, where it reads.
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
