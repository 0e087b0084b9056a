#pragma once

#include <span>
#include <vector>

#include "event_store.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// Encoding of a delivery for ring and multicast.
namespace rtpm::events {

/// Encodes the delivery into `room`, which must be large enough, as sent at `now`. Returns the used
/// part.
[[nodiscard]] ConstBytes encode_group(std::span<const EventRef> group, MonotonicTime now,
                                      MutableBytes room) noexcept;

/// Decodes a delivery into `group`, whose capacity is kGroupSizeMax; its events refer to `bytes`.
/// False if malformed.
[[nodiscard]] bool decode_group(ConstBytes bytes, std::vector<EventView>& group) noexcept;

}  // namespace rtpm::events
