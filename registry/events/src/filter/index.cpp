#include "filter/index.hpp"

#include <algorithm>
#include <bit>
#include <optional>

#include "rtpm/base/assert.hpp"

namespace rtpm::events {
namespace {

// Whether one event can match two of the interests although neither covers the other.
bool may_repeat(std::span<const Interest> interests) noexcept {
  const auto has = [&](bool has_type, bool has_source) {
    return std::ranges::any_of(interests, [&](const Interest& each) {
      return each.type.has_value() == has_type && each.source.has_value() == has_source;
    });
  };
  return has(true, false) && has(false, true);
}

}  // namespace

SubscriptionIndex::SubscriptionIndex(std::size_t interest_count_max)
    : keys_(std::bit_ceil(2 * interest_count_max + 2)), chunks_(interest_count_max) {
  for (std::size_t i = interest_count_max; i-- > 0;) {
    chunks_[i].next = first_free_;
    first_free_ = static_cast<std::uint32_t>(i);
  }
  free_count_ = interest_count_max;
}

std::size_t SubscriptionIndex::home_of(Kind kind, std::uint64_t value) const noexcept {
  const std::uint64_t mixed = (value + kind + 1) * 0x9e37'79b9'7f4a'7c15ULL;
  return static_cast<std::size_t>(mixed >> 32) & (keys_.size() - 1);
}

// The key's slot, or the slot to insert it into.
std::size_t SubscriptionIndex::slot_of(Kind kind, std::uint64_t value) const noexcept {
  std::size_t slot = home_of(kind, value);
  while (keys_[slot].list != kNone && (keys_[slot].value != value || keys_[slot].kind != kind)) {
    slot = (slot + 1) & (keys_.size() - 1);
  }
  return slot;
}

bool SubscriptionIndex::add(std::uint32_t subscription, std::span<const Interest> interests,
                            bool is_decided) noexcept {
  RTPM_ASSERT(subscription < kRepeatBit, "a subscription's number leaves two bits free");
  if (!has_room(interests.size())) return false;
  const std::uint32_t entry =
      subscription | (is_decided ? kDecidedBit : 0) | (may_repeat(interests) ? kRepeatBit : 0);
  for (const Interest& interest : interests) {
    if (!interest.type && !interest.source) {
      push(everything_, entry);
      continue;
    }
    const Kind kind = !interest.source ? kOfType : interest.type ? kExact : kOfSource;
    const std::uint64_t value =
        std::uint64_t{interest.type.value_or(0)} << 32 | interest.source.value_or(0);
    Key& key = keys_[slot_of(kind, value)];
    if (key.list == kNone) {
      key.value = value;
      key.kind = kind;
      ++key_counts_[kind];
    }
    push(key.list, entry);
  }
  return true;
}

void SubscriptionIndex::remove(std::uint32_t subscription,
                               std::span<const Interest> interests) noexcept {
  for (const Interest& interest : interests) {
    if (!interest.type && !interest.source) {
      erase(everything_, subscription);
      continue;
    }
    const Kind kind = !interest.source ? kOfType : interest.type ? kExact : kOfSource;
    const std::uint64_t value =
        std::uint64_t{interest.type.value_or(0)} << 32 | interest.source.value_or(0);
    const std::size_t slot = slot_of(kind, value);
    erase(keys_[slot].list, subscription);
    if (keys_[slot].list == kNone) {
      --key_counts_[kind];
      free_key(slot);
    }
  }
}

// Only the first chunk of a list has free entries.
void SubscriptionIndex::push(std::uint32_t& list, std::uint32_t entry) noexcept {
  if (list == kNone || chunks_[list].count == kChunkCapacity) {
    const std::uint32_t chunk = first_free_;
    first_free_ = chunks_[chunk].next;
    chunks_[chunk].next = list;
    chunks_[chunk].count = 0;
    list = chunk;
  }
  Chunk& first = chunks_[list];
  first.entries[first.count++] = entry;
  --free_count_;
}

void SubscriptionIndex::erase(std::uint32_t& list, std::uint32_t subscription) noexcept {
  for (std::uint32_t at = list; at != kNone; at = chunks_[at].next) {
    Chunk& chunk = chunks_[at];
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      if ((chunk.entries[i] & ~(kDecidedBit | kRepeatBit)) != subscription) continue;
      Chunk& first = chunks_[list];
      chunk.entries[i] = first.entries[--first.count];
      if (first.count == 0) {
        const std::uint32_t next = first.next;
        first.next = first_free_;
        first_free_ = list;
        list = next;
      }
      ++free_count_;
      return;
    }
  }
  RTPM_ASSERT(false, "remove() has the interests of add()");
}

// Backward-shift deletion: moves the keys that a search could no longer reach.
void SubscriptionIndex::free_key(std::size_t slot) noexcept {
  const std::size_t mask = keys_.size() - 1;
  std::size_t hole = slot;
  for (std::size_t at = (hole + 1) & mask; keys_[at].list != kNone; at = (at + 1) & mask) {
    const std::size_t home = home_of(keys_[at].kind, keys_[at].value);
    if (((at - home) & mask) < ((at - hole) & mask)) continue;
    keys_[hole] = keys_[at];
    keys_[at].list = kNone;
    hole = at;
  }
  keys_[hole].list = kNone;
}

}  // namespace rtpm::events
