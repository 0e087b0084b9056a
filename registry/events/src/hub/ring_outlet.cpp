#include "hub/ring_outlet.hpp"

#include <bit>
#include <string>

#include "broadcast/broadcast_group.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::events {

expected<std::unique_ptr<RingOutlet>, SetupError> RingOutlet::make(std::uint32_t size,
                                                                   std::uint32_t payload_size_max) {
  if (!std::has_single_bit(size) || size < kRingSizeMin) {
    return setup_error("a ring of " + std::to_string(size) + " bytes can't be made", "",
                       "give it 2^n bytes, at least 65536, or 0 for none");
  }
  const std::uint64_t id = rt::random_u64();
  auto memory = transport::BroadcastMemory::make(ring_memory_size(size));
  if (!memory) return unexpected{std::move(memory.error())};
  auto door = transport::BroadcastDoor::open(id);
  if (!door) return unexpected{std::move(door.error())};
  return std::unique_ptr<RingOutlet>(
      new RingOutlet(id, std::move(*memory), std::move(*door), payload_size_max));
}

RingOutlet::RingOutlet(std::uint64_t id, transport::BroadcastMemory memory,
                       transport::BroadcastDoor door, std::uint32_t payload_size_max)
    : id_(id),
      memory_(std::move(memory)),
      door_(std::move(door)),
      writer_(memory_.bytes(), id),
      encoded_(kGroupSizeMax * event_span(payload_size_max) / sizeof(std::uint64_t)) {}

void RingOutlet::broadcast(std::span<const SubscriptionNumber> subscriptions,
                           std::span<const EventRef> group) noexcept {
  SlotSet slots;
  for (const SubscriptionNumber number : subscriptions)
    slots.add(number);
  const ConstBytes events =
      encode_group(group, rt::now(), std::as_writable_bytes(std::span(encoded_)));
  const auto count = static_cast<std::uint32_t>(group.size());
  if (writer_.write(slots, events, count)) {
    wake_bits_ |= slots.wake_bits();
    return;
  }
  for (const SubscriptionNumber number : subscriptions)
    exchange_->losses(number).too_large_count += count;
}

}  // namespace rtpm::events
