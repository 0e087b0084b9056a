#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "event_store.hpp"

namespace rtpm::events {

/// The latest events of each type and source, for late joiners.
/// @ownership its slots, allocated at construction; references to the events
class History {
 public:
  /// Keeps `depth` (0…64) events each for up to `key_count_max` pairs of type and source, and none
  /// for further pairs.
  History(std::size_t key_count_max, std::uint32_t depth);

  /// Stores the event, replacing the oldest of its type and source.
  void add(const EventRef& event) noexcept;
  /// Evicts events until `is_enough()`, or until none are left.
  template <class Enough>
  void evict_until(Enough is_enough) noexcept {
    for (std::size_t i = 0; i < entries_.size() && !is_enough(); ++i) {
      hand_ = (hand_ + 1) % entries_.size();
      entries_[hand_].event = EventRef();
    }
  }
  /// Visits the last `count` events of each type and source in order of arrival.
  template <class Visitor>
  void visit_last(std::uint32_t count, Visitor visit) noexcept {
    const std::size_t chosen = choose(count);
    for (std::size_t i = 0; i < chosen; ++i)
      visit(*chosen_[i]);
  }

 private:
  struct Key {
    bool is_used = false;
    std::uint64_t value = 0;
    std::uint64_t count = 0;  ///< Events so far; selects the next slot.
  };
  struct Entry {
    EventRef event{};
    std::uint64_t arrival = 0;
  };
  [[nodiscard]] std::size_t slot_of(std::uint64_t value) const noexcept;
  [[nodiscard]] std::size_t choose(std::uint32_t count) noexcept;

  std::uint32_t depth_ = 0;
  std::vector<Key> keys_;
  std::vector<Entry> entries_;  ///< `depth_` slots for each key.
  std::vector<const Entry*> ordered_;
  std::vector<const EventRef*> chosen_;
  std::size_t used_count_ = 0;
  std::size_t used_max_ = 0;
  std::size_t hand_ = 0;
  std::uint64_t arrival_ = 0;
};

}  // namespace rtpm::events
