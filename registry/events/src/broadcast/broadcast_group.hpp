#pragma once

#include <span>
#include <vector>

#include "event_store.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// The events of one delivery as many consumers read them: from the ring, or by multicast.
namespace rtpm::events {

/// Writes the delivery into `room`, which is large enough for it, as sent at `now`; gives what is
/// filled.
/// @realtime alloc-free
[[nodiscard]] ConstBytes encode_group(std::span<const EventRef> group, MonotonicTime now,
                                      MutableBytes room) noexcept;

/// Reads a delivery into `group`, which has room for kGroupSizeMax events; they view `bytes`. False
/// if these are none.
/// @realtime alloc-free
[[nodiscard]] bool decode_group(ConstBytes bytes, std::vector<EventView>& group) noexcept;

}  // namespace rtpm::events
