#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "event_store.hpp"

namespace rtpm::events {

/// The last events of each type and source, for consumers that come late.
/// @ownership its places, taken when built, and references to the events
/// @threads  one at a time
/// @realtime alloc-free but for construction
class History {
 public:
  /// So many pairs of type and source, and `depth` (0…64) events of each; what comes beyond is not
  /// remembered, and counted.
  History(std::size_t key_count_max, std::uint32_t depth);

  /// Remembers the event in the place of the oldest of its type and source.
  void add(const EventRef& event) noexcept;
  /// Gives up the oldest events until `store_has_room` says that it is enough, or none are left.
  template <class Enough>
  void evict_until(Enough store_has_room) noexcept {
    for (std::size_t i = 0; i < entries_.size() && !store_has_room(); ++i) {
      hand_ = (hand_ + 1) % entries_.size();
      entries_[hand_].event = EventRef();
    }
  }
  /// Visits the last `count` of each type and source in the order in which they came.
  template <class Visitor>
  void visit_last(std::uint32_t count, Visitor visit) noexcept {
    const std::size_t chosen = choose(count);
    for (std::size_t i = 0; i < chosen; ++i)
      visit(*chosen_[i]);
  }
  /// Events of which no place was left for their type and source.
  [[nodiscard]] std::uint64_t unremembered_count() const noexcept { return unremembered_count_; }

 private:
  struct Key {
    bool is_used = false;
    std::uint64_t value = 0;
    std::uint64_t count = 0;  ///< Of events so far: tells the next place.
  };
  struct Entry {
    EventRef event{};
    std::uint64_t arrival = 0;
  };
  [[nodiscard]] std::size_t slot_of(std::uint64_t value) const noexcept;
  [[nodiscard]] std::size_t choose(std::uint32_t count) noexcept;

  std::uint32_t depth_ = 0;
  std::vector<Key> keys_;
  std::vector<Entry> entries_;  ///< `depth_` for each key.
  std::vector<const Entry*> ordered_;
  std::vector<const EventRef*> chosen_;
  std::size_t used_count_ = 0;
  std::size_t used_max_ = 0;
  std::size_t hand_ = 0;
  std::uint64_t arrival_ = 0;
  std::uint64_t unremembered_count_ = 0;
};

}  // namespace rtpm::events
