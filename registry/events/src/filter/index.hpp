#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "filter/compiled_filter.hpp"

namespace rtpm::events {

/// Finds the subscriptions that may accept an event by its type and source. The cost does not
/// depend on subscriptions to other types.
/// @ownership its memory, allocated at construction
class SubscriptionIndex {
 public:
  /// `interest_count_max` limits the total number of interests.
  explicit SubscriptionIndex(std::size_t interest_count_max);

  /// Adds `subscription` (below 2^30) under `interests`; false, without any change, if they do not
  /// fit. `is_decided`: its filter accepts all events that match the interests.
  [[nodiscard]] bool add(std::uint32_t subscription, std::span<const Interest> interests,
                         bool is_decided) noexcept;
  /// Undoes add().
  void remove(std::uint32_t subscription, std::span<const Interest> interests) noexcept;
  [[nodiscard]] bool has_room(std::size_t interest_count) const noexcept {
    return interest_count <= free_count_;
  }

  /// Calls visit(subscription, is_decided, may_repeat) for each candidate. may_repeat: the same
  /// subscription may be visited twice for one event.
  template <class Visitor>
  void visit(EventType type, SourceId source, Visitor visit) const noexcept {
    const std::uint64_t both = std::uint64_t{type} << 32 | source;
    if (key_counts_[kExact] > 0) visit_list(find(kExact, both), visit);
    if (key_counts_[kOfType] > 0) visit_list(find(kOfType, std::uint64_t{type} << 32), visit);
    if (key_counts_[kOfSource] > 0) visit_list(find(kOfSource, source), visit);
    visit_list(everything_, visit);
  }

 private:
  enum Kind : std::uint8_t { kExact, kOfType, kOfSource, kKindCount, kEverything = kKindCount };
  static constexpr std::uint32_t kNone = 0xffff'ffff;
  static constexpr std::uint32_t kDecidedBit = 1U << 31;
  static constexpr std::uint32_t kRepeatBit = 1U << 30;
  static constexpr std::size_t kChunkCapacity = 14;

  /// Adjacent entries in one cache line.
  struct alignas(64) Chunk {
    std::uint32_t next = kNone;
    std::uint32_t count = 0;
    std::array<std::uint32_t, kChunkCapacity> entries{};
  };
  struct Key {
    std::uint64_t value = 0;
    Kind kind = kExact;
    std::uint32_t list = kNone;  ///< kNone if the slot is free.
  };

  template <class Visitor>
  void visit_list(std::uint32_t list, Visitor& visit) const noexcept {
    for (; list != kNone; list = chunks_[list].next) {
      const Chunk& chunk = chunks_[list];
      for (std::uint32_t i = 0; i < chunk.count; ++i) {
        const std::uint32_t entry = chunk.entries[i];
        visit(entry & ~(kDecidedBit | kRepeatBit), (entry & kDecidedBit) != 0,
              (entry & kRepeatBit) != 0);
      }
    }
  }
  [[nodiscard]] std::size_t home_of(Kind kind, std::uint64_t value) const noexcept;
  [[nodiscard]] std::size_t slot_of(Kind kind, std::uint64_t value) const noexcept;
  [[nodiscard]] std::uint32_t find(Kind kind, std::uint64_t value) const noexcept {
    return keys_[slot_of(kind, value)].list;
  }
  void push(std::uint32_t& list, std::uint32_t entry) noexcept;
  void erase(std::uint32_t& list, std::uint32_t subscription) noexcept;
  void free_key(std::size_t slot) noexcept;

  std::vector<Key> keys_;
  std::vector<Chunk> chunks_;
  std::uint32_t first_free_ = kNone;
  std::size_t free_count_ = 0;
  std::uint32_t everything_ = kNone;
  std::array<std::size_t, kKindCount> key_counts_{};
};

}  // namespace rtpm::events
