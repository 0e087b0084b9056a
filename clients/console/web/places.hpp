#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <string>
#include <utility>

namespace rtpm::console {

/// The connections of one kind, at most `capacity`. A new one is always admitted: above the
/// capacity, the peer with the most connections loses its oldest one, so a peer displaces its own
/// connections first.
/// @threads  one
class PlaceTable {
 public:
  explicit PlaceTable(std::size_t capacity) noexcept : capacity_(capacity) {}
  PlaceTable(const PlaceTable&) = delete;
  PlaceTable& operator=(const PlaceTable&) = delete;

  [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
  [[nodiscard]] bool is_full() const noexcept { return entries_.size() >= capacity_; }

 private:
  friend class Place;
  struct Entry {
    std::uint64_t id = 0;
    std::string peer{};
    std::function<void()> give_way{};
  };

  std::uint64_t enter(std::string peer, std::function<void()> give_way) {
    entries_.push_back({++last_id_, std::move(peer), std::move(give_way)});
    const std::uint64_t id = last_id_;
    while (entries_.size() > capacity_) {
      const auto victim = oldest_of_the_most_frequent();
      const auto leave = std::move(victim->give_way);
      entries_.erase(victim);
      leave();
    }
    return id;
  }
  void leave(std::uint64_t id) {
    std::erase_if(entries_, [id](const Entry& entry) { return entry.id == id; });
  }
  [[nodiscard]] std::list<Entry>::iterator oldest_of_the_most_frequent() {
    std::map<std::string, std::size_t> counts;
    std::size_t most = 0;
    for (const Entry& entry : entries_)
      most = std::max(most, ++counts[entry.peer]);
    return std::find_if(entries_.begin(), entries_.end(),
                        [&](const Entry& entry) { return counts[entry.peer] == most; });
  }

  std::size_t capacity_;
  std::uint64_t last_id_ = 0;
  std::list<Entry> entries_{};  ///< Oldest first.
};

/// A connection's entry in a table; removed on destruction.
class Place {
 public:
  /// @param give_way  called at most once, when another connection displaces this one
  Place(PlaceTable& table, std::string peer, std::function<void()> give_way)
      : table_(&table), id_(table.enter(std::move(peer), std::move(give_way))) {}
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place() { table_->leave(id_); }

 private:
  PlaceTable* table_;
  std::uint64_t id_;
};

}  // namespace rtpm::console
