#include "event_store.hpp"

#include <algorithm>
#include <cstring>

namespace rtpm::events {

EventStore::EventStore(const StoreConfig& config) {
  std::size_t line_count = 0;
  std::size_t slot_count = 0;
  for (const auto& [size, count] : config.classes) {
    line_count += (size + sizeof(Line) - 1) / sizeof(Line) * count;
    slot_count += count;
  }
  lines_.resize(line_count);
  slots_.resize(slot_count);
  std::size_t line = 0;
  std::uint32_t slot = 0;
  for (const auto& [size, count] : config.classes) {
    Class made{size, kNone};
    for (std::uint32_t i = 0; i < count; ++i, ++slot) {
      slots_[slot].memory = lines_[line].bytes;
      slots_[slot].size_class = static_cast<std::uint16_t>(classes_.size());
      slots_[slot].next_free = made.first_free;
      made.first_free = slot;
      line += (size + sizeof(Line) - 1) / sizeof(Line);
    }
    classes_.push_back(made);
    payload_size_max_ = std::max(payload_size_max_, size);
  }
}

EventRef EventStore::put(const EventView& event) noexcept {
  // Falls back to larger slots.
  for (Class& each : classes_) {
    if (each.payload_size_max < event.payload.size() || each.first_free == kNone) continue;
    Slot& slot = slots_[each.first_free];
    each.first_free = slot.next_free;
    slot.header = event.header;
    slot.payload_size = static_cast<std::uint32_t>(event.payload.size());
    slot.reference_count = 1;
    if (!event.payload.empty()) {
      std::memcpy(slot.memory, event.payload.data(), event.payload.size());
    }
    ++held_count_;
    return EventRef(*this, slot);
  }
  return {};
}

void EventStore::release(Slot& slot) noexcept {
  if (--slot.reference_count > 0) return;
  Class& its = classes_[slot.size_class];
  slot.next_free = its.first_free;
  its.first_free = static_cast<std::uint32_t>(&slot - slots_.data());
  --held_count_;
}

}  // namespace rtpm::events
