#include "broadcast/broadcast_group.hpp"

#include "filter/compiled_filter.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::events {

ConstBytes encode_group(std::span<const EventRef> group, MonotonicTime now,
                        MutableBytes room) noexcept {
  EventWriter writer(room);
  for (std::size_t i = 0; i < group.size(); ++i) {
    EventHeader header = group[i].header();
    header.hub_sent = now;
    header.is_continued = i + 1 < group.size();
    const bool is_put = writer.put(header, group[i].payload());
    RTPM_ASSERT(is_put, "the room is for the largest group");
  }
  return writer.bytes();
}

bool decode_group(ConstBytes bytes, std::vector<EventView>& group) noexcept {
  group.clear();
  EventReader events(bytes);
  auto event = events.next();
  for (; event && group.size() < kGroupSizeMax; event = events.next())
    group.push_back(*event);
  return !event && event.error() == EventError::kEnd && !group.empty();
}

}  // namespace rtpm::events
