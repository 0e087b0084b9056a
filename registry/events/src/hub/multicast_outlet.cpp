#include "hub/multicast_outlet.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "broadcast/broadcast_group.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// ev-7.2-3
constexpr Duration kHeartbeatFirst = 5ms;
constexpr Duration kHeartbeatMax = 500ms;

}  // namespace

expected<std::unique_ptr<MulticastOutlet>, SetupError> MulticastOutlet::make(
    const MulticastConfig& config, std::uint32_t payload_size_max,
    std::uint32_t subscription_count_max) {
  auto sender = transport::MulticastSender::open(config.group);
  if (!sender) return unexpected{std::move(sender.error())};
  return std::unique_ptr<MulticastOutlet>(
      new MulticastOutlet(config, std::move(*sender), payload_size_max, subscription_count_max));
}

MulticastOutlet::MulticastOutlet(const MulticastConfig& config, transport::MulticastSender sender,
                                 std::uint32_t payload_size_max,
                                 std::uint32_t subscription_count_max)
    : config_(config),
      sender_(std::move(sender)),
      writer_(rt::random_u64(), config.history_count),
      slots_(subscription_count_max),
      encoded_(kGroupSizeMax * event_span(payload_size_max) / sizeof(std::uint64_t)) {}

std::uint64_t MulticastOutlet::begin_slot(SubscriptionNumber number, std::uint64_t owner) noexcept {
  slots_[number] = {true, static_cast<std::uint32_t>(owner), 0};
  return writer_.next_sequence();
}

void MulticastOutlet::broadcast(std::span<const SubscriptionNumber> subscriptions,
                                std::span<const EventRef> group) noexcept {
  const MonotonicTime now = rt::now();
  const ConstBytes events = encode_group(group, now, std::as_writable_bytes(std::span(encoded_)));
  while (!subscriptions.empty()) {
    const std::size_t count = std::min(subscriptions.size(), kMulticastOwnerCountMax);
    write(subscriptions.first(count), events, group.size());
    subscriptions = subscriptions.subspan(count);
  }
  heartbeat_interval_ = kHeartbeatFirst;
  next_heartbeat_ = now + heartbeat_interval_;
}

void MulticastOutlet::write(std::span<const SubscriptionNumber> subscriptions, ConstBytes events,
                            std::size_t event_count) noexcept {
  std::array<std::uint32_t, kMulticastOwnerCountMax> owners{};
  for (std::size_t i = 0; i < subscriptions.size(); ++i)
    owners[i] = slots_[subscriptions[i]].owner;
  const auto send = [this](ConstBytes datagram) {
    // A failed send counts as a network loss, and is repaired in the same way.
    static_cast<void>(sender_.send(datagram));
  };
  const bool is_written =
      writer_.write(std::span(owners).first(subscriptions.size()), events, send);
  for (const SubscriptionNumber number : subscriptions) {
    if (is_written) {
      slots_[number].written_count += event_count;
    } else {
      exchange_->losses(number).too_large_count += event_count;
    }
  }
}

void MulticastOutlet::on_time(MonotonicTime now) noexcept {
  if (now < next_heartbeat_) return;
  static_cast<void>(sender_.send(writer_.heartbeat()));
  heartbeat_interval_ = std::min(2 * heartbeat_interval_, kHeartbeatMax);
  next_heartbeat_ = now + heartbeat_interval_;
}

Broadcasts::Broadcasts(RingOutlet* ring, MulticastOutlet* multicast,
                       std::uint32_t subscription_count_max)
    : ring_(ring), multicast_(multicast) {
  of_ring_.reserve(subscription_count_max);
  of_multicast_.reserve(subscription_count_max);
}

void Broadcasts::broadcast(std::span<const SubscriptionNumber> subscriptions,
                           std::span<const EventRef> group) noexcept {
  of_ring_.clear();
  of_multicast_.clear();
  for (const SubscriptionNumber number : subscriptions) {
    (multicast_->has_slot(number) ? of_multicast_ : of_ring_).push_back(number);
  }
  if (!of_ring_.empty()) ring_->broadcast(of_ring_, group);
  if (!of_multicast_.empty()) multicast_->broadcast(of_multicast_, group);
}

}  // namespace rtpm::events
