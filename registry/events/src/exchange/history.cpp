#include "exchange/history.hpp"

#include <algorithm>
#include <bit>

namespace rtpm::events {

History::History(std::size_t key_count_max, std::uint32_t depth)
    : depth_(key_count_max == 0 ? 0 : depth),
      keys_(depth_ == 0 ? 0 : std::bit_ceil(2 * key_count_max)),
      entries_(keys_.size() * depth_),
      used_max_(key_count_max) {
  ordered_.reserve(used_max_ * depth_);
  chosen_.reserve(used_max_ * depth_);
}

std::size_t History::slot_of(std::uint64_t value) const noexcept {
  std::size_t slot = static_cast<std::size_t>((value * 0x9e37'79b9'7f4a'7c15ULL) >> 32);
  for (;; ++slot) {
    slot &= keys_.size() - 1;
    if (!keys_[slot].is_used || keys_[slot].value == value) return slot;
  }
}

void History::add(const EventRef& event) noexcept {
  if (depth_ == 0) return;
  const std::uint64_t value = std::uint64_t{event.header().type} << 32 | event.header().source;
  const std::size_t slot = slot_of(value);
  Key& key = keys_[slot];
  if (!key.is_used) {
    if (used_count_ == used_max_) return;
    key = {true, value, 0};
    ++used_count_;
  }
  Entry& entry = entries_[slot * depth_ + key.count++ % depth_];
  entry.event = event;
  entry.arrival = ++arrival_;
}

std::size_t History::choose(std::uint32_t count) noexcept {
  ordered_.clear();
  chosen_.clear();
  for (std::size_t slot = 0; slot < keys_.size(); ++slot) {
    const Key& key = keys_[slot];
    if (!key.is_used) continue;
    const std::uint64_t known = std::min<std::uint64_t>({key.count, depth_, count});
    for (std::uint64_t back = 1; back <= known; ++back) {
      const Entry& entry = entries_[slot * depth_ + (key.count - back) % depth_];
      if (entry.event) ordered_.push_back(&entry);
    }
  }
  std::ranges::sort(ordered_, {}, &Entry::arrival);
  for (const Entry* entry : ordered_)
    chosen_.push_back(&entry->event);
  return chosen_.size();
}

}  // namespace rtpm::events
